"""The mean albedo of each triangle: base colour · vertex colours · texture."""

import numpy as np
from jaxtyping import Float32, Float64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.scene import Mesh, Scene, Texture

# A choice: a texture is averaged over at most this many blocks a side before the lookup.
BLOCKS = 16
# A choice: texels a side that are read of a texture, evenly spread: 16 in a block.
TEXELS = 64


def triangle_albedo(scene: Scene, mesh: Mesh) -> Float32[np.ndarray, "triangles 3"]:
    """Linear albedo of each triangle of a mesh; a texture is looked up once, blurred, at the centroid."""
    material = scene.materials[mesh.material]
    albedo = material.base_color * mesh.colors[mesh.triangles].mean(axis=1)
    if material.texture is not None:
        albedo *= _looked_up(scene.textures[material.texture], mesh.uv[mesh.triangles].mean(axis=1))
    return np.clip(albedo, 0.0, 1.0).astype(np.float32)


def _looked_up(texture: Texture, uv: Float32[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 3"]:
    """Texels of the blurred texture, linear. Every wrap mode counts as `repeat`."""
    rows, columns = (np.arange(0, size, -(-size // TEXELS)) for size in texture.texels_srgb.shape[:2])
    linear = linear_from_srgb(texture.texels_srgb[rows[:, None], columns] / 255.0)
    height, width, _ = linear.shape
    rows, columns = (np.linspace(0, size, min(size, BLOCKS) + 1).astype(int) for size in (height, width))
    sums = np.add.reduceat(np.add.reduceat(linear, rows[:-1], axis=0), columns[:-1], axis=1)
    blocks = sums / (np.diff(rows)[:, None] * np.diff(columns))[:, :, None]
    wrapped = np.nan_to_num(uv.astype(np.float64)) % 1.0
    size = np.array([len(columns) - 1, len(rows) - 1])
    x, y = np.minimum((wrapped * size).astype(np.int64), size - 1).T
    return blocks[y, x]
