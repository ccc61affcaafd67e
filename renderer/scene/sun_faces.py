"""The RSM faces of a directional light: one over the whole scene, and finer ones within it around the eye.

One face over kilometres of ground has texels that are metres wide. So each further face is finer, as are the
levels of a clipmap (Tanner et al. 1998, "The clipmap") and the partitions of a shadow map (Lauritzen et al.
2010, "Sample distribution shadow maps"). Faces share out the light: where a finer one lies, a coarser one
carries no flux.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.scene import Instance, Scene
from vpltune.renderer.scene.transforms import transform_points

SIZE_STEP = 2.0**0.125
"""A choice: ratio of consecutive sizes of a snapped face. It costs at most 1/12 of the texels per axis."""
NESTED_RATIO = 8
"""How much smaller each is than the one around it. A choice: as many texels of the next lie in one of it."""
MOST_NESTED_FACES = 3
"""A choice: on 10 km of ground, the finest is then 28 m wide."""


@dataclass(frozen=True)
class SunGrid:
    """What the faces of a directional light are laid out by."""

    cells: int
    """Texels along the side of a face."""
    eye_world: tuple[float, float, float]
    """The camera's position, world units: nested faces lie around it."""
    nested_faces: int = 0
    """Finer faces within the outer one: `nested_face_count`."""
    length: float | None = None
    """A length of the scene at rest, world units: the outer face goes by steps of it, and by whole texels, so
    that texels do not crawl while bounds change. None fits the face tightly to the bounds."""


@dataclass(frozen=True, eq=False)
class SunFace:
    """An orthographic face in the light's own axes (right, up, back), world units."""

    center: Float64[np.ndarray, " 2"]
    """Along right and up."""
    extent: Float64[np.ndarray, " 2"]
    """Half width and height."""
    front: float
    """Where its depths begin, along back."""
    depth: float
    """The range of its depths."""


def nested_face_count(scene: Scene) -> int:
    """Finer faces of each directional light of a scene: none where it is not much larger than its parts.

    One is made where its half width is at least the median of the triangles' longest edges. Half the scene's
    diagonal stands for the outer face. So scale does not matter, and all frames have as many: the scene is
    that at rest.
    """
    if scene.triangle_count() == 0:
        return 0
    low, high = scene.bounds()
    widest = float(np.linalg.norm(high - low)) / 2.0
    edge = float(np.median(np.concatenate([_longest_edges(scene, each) for each in scene.instances])))
    # Where most triangles are points, there are no parts that finer texels would show.
    levels = math.log(widest / edge, NESTED_RATIO) if edge > 0.0 else 0.0
    return min(max(int(levels), 0), MOST_NESTED_FACES)


def sun_faces(
    rotation: Float64[np.ndarray, "3 3"], bounds: Float64[np.ndarray, "2 3"], grid: SunGrid
) -> tuple[SunFace, ...]:
    """The faces of a directional light, each nested in the one before.

    Args:
        rotation: columns right, up and back of the light.
        bounds: low and high corner of the scene, world units.
        grid: texels, eye and snapping.
    """
    faces = [_outer_face(rotation, bounds, grid)]
    eye = (np.array(grid.eye_world) @ rotation)[:2]
    for _ in range(grid.nested_faces):
        faces.append(_nested_face(faces[-1], eye, grid.cells))
    return tuple(faces)


def _longest_edges(scene: Scene, instance: Instance) -> np.ndarray:
    """The longest edge of each triangle of an instance, world units."""
    mesh = scene.meshes[instance.mesh]
    corners = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)


def _outer_face(rotation: np.ndarray, bounds: np.ndarray, grid: SunGrid) -> SunFace:
    """A face that contains all of `bounds`."""
    selector = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
    corners = bounds[selector, np.arange(3)] @ rotation
    low, high = corners.min(axis=0), corners.max(axis=0)
    # A margin of 1 % of the diagonal: a flat scene has no depth of its own, and surfaces on the bounds must
    # not fall on the border of the tile.
    room = 0.01 * float(np.linalg.norm(high - low))
    extent, center = (high - low) / 2.0 + room, (low + high) / 2.0
    across, middle = extent[:2], center[:2]
    if grid.length is not None:
        # Rounding moves the centre by up to half a cell, which is 1/cells of the extent.
        needed = across * (1.0 + 1.0 / (grid.cells - 1.0))
        across = grid.length * SIZE_STEP ** np.ceil(np.log(needed / grid.length) / math.log(SIZE_STEP))
        cell = 2.0 * across / grid.cells
        middle = np.round(middle / cell) * cell
    return SunFace(middle, across, high[2] + room, 2.0 * extent[2])


def _nested_face(outer: SunFace, eye: np.ndarray, cells: int) -> SunFace:
    """A face of whole texels of `outer`, as nearly around the eye as they allow.

    Each texel of `outer` is then wholly in it or wholly outside. It stands still while the eye moves by less
    than a texel. Its half width is that of the wider axis of `outer`, divided by `NESTED_RATIO`.
    """
    texel = 2.0 * outer.extent / cells
    # 1e-9: a quotient that is whole but for rounding is not rounded up.
    texels = np.minimum(np.ceil(2.0 * outer.extent.max() / NESTED_RATIO / texel - 1e-9), cells)
    low = outer.center - outer.extent
    first = np.clip(np.round((eye - low) / texel - texels / 2.0), 0.0, cells - texels)
    extent = texels * texel / 2.0
    return SunFace(low + first * texel + extent, extent, outer.front, outer.depth)
