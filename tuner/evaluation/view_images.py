"""images.npz: the images of a fit's views, which a report can show at any exposure.

There is one file for each fit. The members of a view have its index in metrics.json's `per_view` as prefix:

    0/level                 float32   mean irradiance of the reference, direct and indirect, in W/m²
    0/valid                 bool      [height, width]      where runtime and reference see the same surface
    0/reference_albedo      float16   [height, width, 3]
    0/reference_direct      float16   [height, width, 3]   irradiance over `level`
    0/reference_indirect    float16   [height, width, 3]
    0/albedo, 0/direct                                     the same in the runtime
    0/default_indirect, 0/tuned_indirect, 0/ceiling_indirect

Row 0 is at the top. Irradiance relative to its mean fits half floats at any scale and in any unit.
"""

import math
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from jaxtyping import Bool, Float32

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.tuner.metrics.radiance import radiance

VARIANTS = ("default", "tuned", "ceiling")
MAXIMUM_PIXELS = 256 * 192
"""Most pixels of a view that are kept; a larger view keeps every second, third … row and column. A choice."""
MAXIMUM_VIEWS = {"fitted": 16, "held_out": 8}
"""Number of views that are kept of each split, the first ones. A choice: with `MAXIMUM_PIXELS`, it limits the
file to 60 MB."""
# Twice what the most views of the most pixels take: six bytes for each of eight images, and one for `valid`.
_MOST_BYTES = 2 * sum(MAXIMUM_VIEWS.values()) * MAXIMUM_PIXELS * (8 * 6 + 1)
# The versions of numpy's format that it writes itself.
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
# What numpy raises for a damaged archive; TypeError is for a file with a single array, which is no archive.
_UNREADABLE = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    RuntimeError,
    zlib.error,
    zipfile.BadZipFile,
)
_LARGEST_HALF = float(np.finfo(np.float16).max)


@dataclass(frozen=True, eq=False)
class ViewImages:
    """One view: albedo, direct irradiance, and indirect irradiance of each variant, in units of `level`."""

    index: int
    """The view's index in metrics.json's `per_view`."""
    level: float
    """Mean irradiance of the reference [W/m²]."""
    valid: Bool[np.ndarray, "height width"]
    """Where runtime and reference see the same surface."""
    reference_albedo: Float32[np.ndarray, "height width 3"]
    reference_direct: Float32[np.ndarray, "height width 3"]
    albedo: Float32[np.ndarray, "height width 3"]
    direct: Float32[np.ndarray, "height width 3"]
    indirect: dict[str, Float32[np.ndarray, "height width 3"]]
    """By variant: `reference`, and each of `VARIANTS`."""

    def radiance(self, variant: str) -> Float32[np.ndarray, "height width 3"]:
        """Direct plus indirect radiance, in `level`/sr.

        Args:
            variant: `reference`, with the reference's albedo, or one of `VARIANTS`.
        """
        if variant == "reference":
            return radiance(self.reference_albedo, self.reference_direct, self.indirect[variant])
        return radiance(self.albedo, self.direct, self.indirect[variant])

    def light(self, variant: str) -> Float32[np.ndarray, "height width 3"]:
        """As `radiance`, but all with the runtime's albedo, and black where not valid: what FLIP compares."""
        direct = self.reference_direct if variant == "reference" else self.direct
        return radiance(self.albedo, direct, self.indirect[variant]) * self.valid[..., None]


def write_view_images(path: Path, views: Sequence[Any]) -> None:
    """Write the images of evaluated views (`tuner.evaluation.evaluate.EvaluatedView`) to images.npz.

    The file appears only once it is complete.

    Raises:
        InputError: the path cannot be written to.
    """
    left, members = dict(MAXIMUM_VIEWS), {}
    for index, evaluated in enumerate(views):
        split = evaluated.view.view.split
        if left[split] > 0:
            left[split] -= 1
            members |= {f"{index}/{name}": array for name, array in _members(evaluated).items()}
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **members)


def _members(evaluated: Any) -> dict[str, np.ndarray]:
    view = evaluated.view
    reference, captured, valid = view.reference, view.captured, view.valid
    seen = (reference.direct_irradiance + reference.irradiance)[valid]
    # As it is stored: rounded afterwards, it would no longer be what the images were divided by.
    level = float(np.float32(seen.mean(dtype=np.float64))) if seen.any() else 1.0
    step = 1
    while -(-valid.shape[0] // step) * -(-valid.shape[1] // step) > MAXIMUM_PIXELS:
        step += 1
    irradiances = {
        "reference_direct": reference.direct_irradiance,
        "reference_indirect": reference.irradiance,
        "direct": captured.direct_irradiance,
        **{f"{variant}_indirect": evaluated.irradiance[variant] for variant in VARIANTS},
    }
    relative = {
        name: np.clip(image[::step, ::step].astype(np.float64) / level, 0.0, _LARGEST_HALF)
        for name, image in irradiances.items()
    }
    albedos = {"reference_albedo": reference.albedo, "albedo": captured.albedo}
    halves = {**{name: albedo[::step, ::step] for name, albedo in albedos.items()}, **relative}
    return {
        "level": np.array(level, np.float32),
        "valid": valid[::step, ::step],
        **{name: image.astype(np.float16) for name, image in halves.items()},
    }


def read_view_images(path: Path) -> tuple[ViewImages, ...]:
    """Read images.npz: the views that it holds, in the order of metrics.json; none if there is no file.

    Raises:
        InputError: the file is not an images.npz, a member is missing, or one has the wrong shape or type.
    """
    if not path.exists():
        return ()
    if not path.is_file():
        raise InputError(f"{path}: must be a file")
    try:
        with path.open("rb") as file:
            _check_size(file, path)
            with np.load(file, allow_pickle=False) as archive:
                members = {name: archive[name] for name in archive.files}
    except InputError:
        raise
    except _UNREADABLE as error:
        raise InputError(f"{path}: not a readable images.npz ({error})") from error
    places = {name.partition("/")[0] for name in members}
    # Python refuses to read numbers of thousands of digits; no fit has 1e9 views.
    indices = sorted({int(place) for place in places if place.isdecimal() and len(place) < 10})
    return tuple(_view(path, index, members) for index in indices)


def _check_size(file: IO[bytes], path: Path) -> None:
    """Refuse an archive that unpacks to more than a fit writes: zeros take a thousandth of that in the file.

    numpy allocates what the header of a member says, so the headers are read first.
    """
    left = _MOST_BYTES
    with zipfile.ZipFile(file) as archive:
        for member in archive.infolist():
            with archive.open(member) as stream:
                version = np.lib.format.read_magic(stream)
                read_header = _HEADERS.get(version)
                if read_header is None:
                    raise InputError(f"{path}: member {member.filename!r:.60} has an unknown version")
                shape, _, dtype = read_header(stream)
            left -= max(math.prod(shape) * dtype.itemsize, member.file_size)
            if left < 0:
                raise InputError(
                    f"{path}: its arrays must take at most {_MOST_BYTES >> 20} MiB together, and "
                    f"{member.filename!r:.60} exceeds that"
                )
    file.seek(0)


def _view(path: Path, index: int, members: dict[str, np.ndarray]) -> ViewImages:
    def member(name: str) -> np.ndarray:
        if f"{index}/{name}" not in members:
            raise InputError(f"{path}: member {index}/{name} is missing")
        return members[f"{index}/{name}"]

    valid = member("valid")
    if valid.ndim != 2 or not 0 < valid.size <= MAXIMUM_PIXELS or valid.dtype != bool:
        raise InputError(f"{path}: member {index}/valid must be an image of at most {MAXIMUM_PIXELS} pixels")

    def image(name: str) -> np.ndarray:
        pixels = member(name)
        if pixels.shape != (*valid.shape, 3) or pixels.dtype != np.float16 or not np.isfinite(pixels).all():
            raise InputError(f"{path}: member {index}/{name} must be {valid.shape} finite half floats")
        return pixels.astype(np.float32)

    level = member("level")
    if level.shape != () or level.dtype != np.float32 or not np.isfinite(level):
        raise InputError(f"{path}: member {index}/level must be one finite float32")
    return ViewImages(
        index=index,
        level=float(level),
        valid=valid,
        reference_albedo=image("reference_albedo"),
        reference_direct=image("reference_direct"),
        albedo=image("albedo"),
        direct=image("direct"),
        indirect={name: image(f"{name}_indirect") for name in ("reference", *VARIANTS)},
    )
