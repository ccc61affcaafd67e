"""What a reference is made from, as one hash: two keys are equal when the references are."""

import hashlib
import importlib.metadata
import json

import numpy as np

from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View, light_to_json

ESTIMATOR_VERSION = 1
"""Raise whenever the estimator gives other numbers from the same scene: old entries are then passed over."""


def scene_digest(scene: Scene) -> str:
    """Hash of a scene's geometry, materials and textures; of no names, and of no light or camera."""
    digest = hashlib.sha256()
    for mesh in scene.meshes:
        for array in (mesh.positions, mesh.normals, mesh.uv, mesh.colors, mesh.triangles):
            _add_array(digest, array)
        digest.update(f"material {mesh.material};".encode())
    for instance in scene.instances:
        digest.update(f"instance of {instance.mesh};".encode())
        _add_array(digest, instance.to_world)
    for material in scene.materials:
        digest.update(f"texture {material.texture};".encode())
        _add_array(digest, material.base_color)
    for texture in scene.textures:
        digest.update(f"wrap {texture.wrap_u} {texture.wrap_v};".encode())
        _add_array(digest, texture.texels_srgb)
    return digest.hexdigest()


def reference_key(
    scene_hash: str,
    view: View,
    *,
    seed: int,
    noise_target: float,
    max_samples: int,
    bounces: int | None,
    variant: str,
) -> str:
    """Hash of all that a view's reference depends on; `scene_hash` is `scene_digest`'s."""
    content = {
        "scene": scene_hash,
        "camera": [view.camera.to_world.ravel().tolist(), view.camera.yfov],
        "lights": [light_to_json(light) for light in view.lights],
        "size": list(view.size),
        "seed": seed,
        "noise_target": noise_target,
        "max_samples": max_samples,
        "bounces": bounces,
        "variant": variant,
        "mitsuba": importlib.metadata.version("mitsuba"),
        "estimator": ESTIMATOR_VERSION,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _add_array(digest, array: np.ndarray) -> None:
    # Shape and type too: otherwise numbers could move from one array to the next unseen.
    digest.update(f"{array.dtype.str}{array.shape};".encode())
    digest.update(np.ascontiguousarray(array).data)
