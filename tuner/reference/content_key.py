"""Cache keys: one hash over everything that a reference is computed from."""

import hashlib
import importlib.metadata
import json

import numpy as np

from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View, light_to_json

ESTIMATOR_VERSION = 2
"""Increase it whenever a code change makes the estimator return different values for the same input. Entries
of older versions are then ignored."""


def scene_digest(scene: Scene) -> str:
    """Hex SHA-256 of a scene's geometry, materials, textures and environment, without names, lights and
    cameras. What does not glow adds nothing of its emission."""
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
        if not material.is_opaque:
            alpha = f"{material.alpha_mode} {material.opacity!r} {material.alpha_cutoff!r};"
            digest.update(alpha.encode())
        if material.glows:
            glow = f"{material.emission_texture} {material.emits_both_ways}"
            digest.update(f"emission {tuple(map(float, material.emission))!r} {glow};".encode())
    for texture in scene.textures:
        digest.update(f"wrap {texture.wrap_u} {texture.wrap_v};".encode())
        _add_array(digest, texture.texels_srgb)
        if texture.opacity is not None:
            _add_array(digest, texture.opacity)
    if scene.environment is not None:
        digest.update(b"environment;")
        _add_array(digest, scene.environment.radiance)
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
    """Hex SHA-256 of everything that a view's reference depends on.

    `scene_hash` comes from `scene_digest`, `variant` is the name of the Mitsuba variant. The other arguments
    are those of `reference_views`.
    """
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
    # Hash the shape and dtype too: otherwise values could move from one array to the next without changing
    # the hash.
    digest.update(f"{array.dtype.str}{array.shape};".encode())
    digest.update(np.ascontiguousarray(array).data)
