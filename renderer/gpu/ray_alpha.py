"""What rays need to know of surfaces with holes: texture coordinates, opacity, and the alpha of their texels.

All of it is one buffer of 32-bit words: materials, then coordinates, then alpha, four texels to a word. So a
program binds one more buffer, of the eight or more that OpenGL 4.5 grants.
"""

import numpy as np
from jaxtyping import Int64, UInt32

from vpltune.renderer.scene.scene import Scene, Texture, Wrap

_WRAPS: tuple[Wrap, ...] = ("repeat", "mirrored_repeat", "clamp_to_edge")
"""A wrap mode is stored as its index in this tuple, which `shaders/common/ray_alpha.glsl` knows."""
_OPAQUE = Texture("opaque", np.full((1, 1, 3), 255, np.uint8), opacity=np.full((1, 1), 255, np.uint8))
"""What materials without a texture look up."""
_MATERIAL_WORDS = 8
"""Opacity, cutoff, first texel, width, height, wrap along u and v, and 1 if blended."""
_COORDINATES = 6
"""Words of a triangle: u and v of its corners."""


class RayAlpha:
    """The words that `shaders/common/ray_alpha.glsl` reads.

    Args:
        scene: materials, textures and coordinates.
        surfaces: of each tree of a ray hierarchy, its mesh and which of its triangles.
    """

    of_trees: UInt32[np.ndarray, "trees 2"]
    """For each tree: the word where triangle 0 of all would have its coordinates, modulo 2³²; one more than
    the word of its material. Both are 0 for an opaque tree."""
    words: UInt32[np.ndarray, " words"]

    def __init__(self, scene: Scene, surfaces: list[tuple[int, Int64[np.ndarray, " triangles"]]]):
        used = sorted({scene.meshes[mesh].material for mesh, _ in surfaces})
        rows = {i: row for row, i in enumerate(i for i in used if not scene.materials[i].is_opaque)}
        self.of_trees = np.zeros((len(surfaces), 2), np.uint32)
        coordinates: list[np.ndarray] = []
        place, first_triangle = _MATERIAL_WORDS * len(rows), 0
        for tree, (index, triangles) in enumerate(surfaces):
            mesh = scene.meshes[index]
            if mesh.material in rows:
                start = (place - _COORDINATES * first_triangle) % 2**32
                self.of_trees[tree] = start, _MATERIAL_WORDS * rows[mesh.material] + 1
                corners = np.ascontiguousarray(mesh.uv[mesh.triangles[triangles]], np.float32)
                coordinates.append(corners.view(np.uint32).ravel())
                place += _COORDINATES * len(triangles)
            first_triangle += len(triangles)
        materials = np.zeros((len(rows), _MATERIAL_WORDS), np.uint32)
        texels: list[np.ndarray] = []
        placed: dict[int | None, int] = {}
        for row, material in zip(materials, (scene.materials[i] for i in rows), strict=True):
            texture = _OPAQUE if material.texture is None else scene.textures[material.texture]
            opacity = _OPAQUE.opacity if texture.opacity is None else texture.opacity
            assert opacity is not None
            if material.texture not in placed:
                placed[material.texture] = place
                padded = np.concatenate([opacity.ravel(), np.zeros(-opacity.size % 4, np.uint8)])
                # The shader takes the lowest byte first.
                texels.append(padded.view("<u4"))
                place += len(texels[-1])
            row[:2] = np.array([material.opacity, material.alpha_cutoff], np.float32).view(np.uint32)
            row[2:5] = placed[material.texture], opacity.shape[1], opacity.shape[0]
            row[5:] = _WRAPS.index(texture.wrap_u), _WRAPS.index(texture.wrap_v), material.is_blended
        self.words = np.concatenate([materials.ravel(), *coordinates, *texels]).astype(np.uint32)

    @property
    def is_needed(self) -> bool:
        """Whether a surface has holes."""
        return len(self.words) > 0
