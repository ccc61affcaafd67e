"""Panes: surfaces that let most of the light pass, and are in nobody's way."""

from vpltune.renderer.scene.scene import Mesh, Scene

# A choice: from this mean opacity on, a blended surface counts as a wall where it must be one or the other.
LEAST_OPACITY_OF_WALLS = 0.5


def is_pane(scene: Scene, mesh: Mesh) -> bool:
    """Whether a mesh is blended and lets more than half of the light pass, in the mean of its texture."""
    material = scene.materials[mesh.material]
    if not material.is_blended:
        return False
    texture = None if material.texture is None else scene.textures[material.texture]
    texels = 1.0 if texture is None or texture.opacity is None else float(texture.opacity.mean()) / 255.0
    return material.opacity * texels < LEAST_OPACITY_OF_WALLS
