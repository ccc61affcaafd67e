"""images.npz: what a fit keeps of its views, so that a report can show them under any exposure.

One file for a fit. For every view that is kept, under the prefix of its place in metrics.json's `per_view`:

    0/level                 float32   the reference's mean irradiance, direct and indirect, in W/m²
    0/valid                 bool      [height, width]      where runtime and reference see a surface
    0/reference_albedo      float16   [height, width, 3]
    0/reference_direct      float16   [height, width, 3]   irradiance over `level`
    0/reference_indirect    float16   [height, width, 3]
    0/albedo, 0/direct                                     as the runtime has them
    0/default_indirect, 0/tuned_indirect, 0/ceiling_indirect

Row 0 is at the top. Irradiance over its mean fits half floats whatever the scene's units are.
"""

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.tuner.metrics.radiance import radiance

VARIANTS = ("default", "tuned", "ceiling")
MAXIMUM_PIXELS = 256 * 192
"""Of a view: a larger one is kept as every second, third … pixel of every such row."""
MAXIMUM_VIEWS = {"fitted": 16, "held_out": 8}
"""The first of each split; with `MAXIMUM_PIXELS` this bounds the file by 60 MB."""
# A damaged archive shows itself in any of these; TypeError is that of a lone array, which is no archive.
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
    """One view: surfaces, direct light and all the indirect irradiances that were compared.

    Irradiance is in units of `level`.
    """

    index: int
    """Place in `per_view`."""
    level: float
    """W/m²"""
    valid: Bool[np.ndarray, "height width"]
    reference_albedo: Float32[np.ndarray, "height width 3"]
    reference_direct: Float32[np.ndarray, "height width 3"]
    albedo: Float32[np.ndarray, "height width 3"]
    direct: Float32[np.ndarray, "height width 3"]
    indirect: dict[str, Float32[np.ndarray, "height width 3"]]
    """Of `reference` and of each of `VARIANTS`."""

    def radiance(self, variant: str) -> Float32[np.ndarray, "height width 3"]:
        """The whole image, direct and indirect, in `level`/sr; `variant` may be `reference`."""
        if variant == "reference":
            return radiance(self.reference_albedo, self.reference_direct, self.indirect[variant])
        return radiance(self.albedo, self.direct, self.indirect[variant])

    def light(self, variant: str) -> Float32[np.ndarray, "height width 3"]:
        """As `radiance`, all variants with the runtime's albedo, and black where not valid: what FLIP
        compares."""
        direct = self.reference_direct if variant == "reference" else self.direct
        return radiance(self.albedo, direct, self.indirect[variant]) * self.valid[..., None]


def write_view_images(path: Path, views: Sequence[Any]) -> None:
    """Write what `tuner.evaluation.evaluate` made of each view (`EvaluatedView`), whole or not at all.

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
    level = float(seen.mean(dtype=np.float64)) if seen.any() else 1.0
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
    """The views that `path` holds, in the order of metrics.json; none where there is no such file.

    Raises:
        InputError: not an images.npz, or its members do not fit together.
    """
    if not path.exists():
        return ()
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            members = {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise InputError(f"{path}: not a readable images.npz ({error})") from error
    indices = sorted({int(name.partition("/")[0]) for name in members if name.partition("/")[0].isdecimal()})
    return tuple(_view(path, index, members) for index in indices)


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

    return ViewImages(
        index=index,
        level=float(member("level")),
        valid=valid,
        reference_albedo=image("reference_albedo"),
        reference_direct=image("reference_direct"),
        albedo=image("albedo"),
        direct=image("direct"),
        indirect={name: image(f"{name}_indirect") for name in ("reference", *VARIANTS)},
    )
