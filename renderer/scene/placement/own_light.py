"""Whether a scene shines without any light."""

from vpltune.renderer.scene.scene import Scene


def has_own_light(scene: Scene) -> bool:
    """Whether a scene shines without any light: it has an environment, or surfaces that glow."""
    if scene.environment is not None and scene.environment.radiance.any():
        return True
    for index in {scene.meshes[instance.mesh].material for instance in scene.instances}:
        material = scene.materials[index]
        texture = None if material.emission_texture is None else scene.textures[material.emission_texture]
        if material.glows and (texture is None or texture.texels_srgb.any()):
            return True
    return False
