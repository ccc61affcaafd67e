"""A reference on its way from the process that renders it to the one that shows it."""

import functools
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Float64

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import written_whole


@dataclass(frozen=True, eq=False)
class ReferenceImages:
    """What the window needs of a reference (`tuner.reference.reference_view`), in the same units."""

    irradiance: Float32[np.ndarray, "height width 3"]
    """Indirect irradiance [W/m²]."""
    direct_irradiance: Float32[np.ndarray, "height width 3"]
    albedo: Float32[np.ndarray, "height width 3"]
    position_world: Float64[np.ndarray, "height width 3"]
    valid: Bool[np.ndarray, "height width"]


def write_reference(path: Path, reference: ReferenceImages) -> None:
    """Write the images to an .npz, whole or not at all."""
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{each.name: getattr(reference, each.name) for each in fields(ReferenceImages)})


@functools.lru_cache(maxsize=2)
def read_reference(path: Path) -> ReferenceImages:
    """The images that `write_reference` wrote. The last two files are kept in memory: both panes may ask.

    Raises:
        InputError: the file has gone, or is not one of these.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return ReferenceImages(**{each.name: archive[each.name] for each in fields(ReferenceImages)})
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: the reference cannot be read ({error})") from error
