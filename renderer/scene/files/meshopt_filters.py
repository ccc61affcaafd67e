"""EXT_meshopt_compression's filters, which restore attributes after decompression.

They are specified in EXT_meshopt_compression, appendix B (Kapoulkine 2022). Input outside a filter's range
decodes to some value without an error; accessors check that floats are finite.
"""

import numpy as np
from jaxtyping import UInt8

# The strides in bytes that the specification allows for each filter.
_WORDS = range(4, 257, 4)
FILTER_STRIDES = {
    "NONE": _WORDS,
    "OCTAHEDRAL": (4, 8),
    "QUATERNION": (8,),
    "EXPONENTIAL": _WORDS,
}


def unfiltered(elements: UInt8[np.ndarray, "count stride"], kind: str) -> UInt8[np.ndarray, "count stride"]:
    """The elements with the filter `kind` undone. `kind` and stride must be among `FILTER_STRIDES`."""
    if kind == "NONE" or not len(elements):
        return elements
    decode = {"OCTAHEDRAL": _octahedral, "QUATERNION": _quaternion, "EXPONENTIAL": _exponential}[kind]
    return np.ascontiguousarray(decode(np.ascontiguousarray(elements))).view(np.uint8)


def _octahedral(elements: UInt8[np.ndarray, "count stride"]) -> np.ndarray:
    """Decode octahedral unit vectors to normalised integers. The fourth component is unchanged."""
    dtype = np.dtype("i1") if elements.shape[1] == 4 else np.dtype("<i2")
    stored = elements.view(dtype)
    one = np.where(stored[:, 2:3] == 0, 1, stored[:, 2:3]).astype(np.float32)
    x, y = (stored[:, :2] / one).T
    z = 1.0 - np.abs(x) - np.abs(y)
    fold = np.minimum(z, 0.0)
    vector = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], axis=1)
    vector /= np.linalg.norm(vector, axis=1, keepdims=True)
    decoded = stored.copy()
    decoded[:, :3] = np.rint(vector * np.iinfo(dtype).max).astype(dtype)
    return decoded


def _quaternion(elements: UInt8[np.ndarray, "count stride"]) -> np.ndarray:
    """Decode unit quaternions, stored without their largest component, to normalised integers."""
    stored = elements.view("<i2")
    one = (stored[:, 3:4] | 3).astype(np.float32)
    rest = stored[:, :3] / one * np.float32(np.sqrt(0.5))
    largest = np.sqrt(np.maximum(0.0, 1.0 - (rest**2).sum(axis=1, keepdims=True)))
    components = np.rint(np.clip(np.concatenate([largest, rest], axis=1), -1.0, 1.0) * 32767.0).astype("<i2")
    places = ((stored[:, 3:4] & 3) + np.arange(4)) % 4
    decoded = np.empty_like(stored)
    np.put_along_axis(decoded, places, components, axis=1)
    return decoded


def _exponential(elements: UInt8[np.ndarray, "count stride"]) -> np.ndarray:
    """Decode floats from a signed 8-bit exponent and a signed 24-bit mantissa."""
    stored = elements.view("<i4")
    return np.ldexp(((stored << 8) >> 8).astype("<f4"), stored >> 24)
