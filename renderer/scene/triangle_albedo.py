"""The mean albedo of each triangle: base colour · vertex colours · texture."""

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.scene.scene import Mesh, Scene
from vpltune.renderer.scene.triangle_texels import mean_texels


def triangle_albedo(scene: Scene, mesh: Mesh) -> Float32[np.ndarray, "triangles 3"]:
    """Linear albedo of each triangle of a mesh, in [0, 1], the mean over the part of it that is no hole."""
    material = scene.materials[mesh.material]
    albedo = material.base_color * mesh.colors[mesh.triangles].mean(axis=1).astype(np.float64)
    if material.texture is not None:
        uv = mesh.uv[mesh.triangles].astype(np.float64)
        albedo *= mean_texels(scene.textures[material.texture], uv, material)
    return np.clip(albedo, 0.0, 1.0).astype(np.float32)
