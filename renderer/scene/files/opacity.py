"""Materials whose alpha changes nothing are opaque: many files ask for an alpha mode everywhere."""

from dataclasses import replace

from vpltune.renderer.scene.scene import Material, Texture


def without_idle_alpha(material: Material, texture: Texture | None) -> Material:
    """The material, opaque where no point of it falls below its cutoff.

    Args:
        material: in any alpha mode.
        texture: its texture, if any.
    """
    if material.is_opaque:
        return material
    if _least_opacity(material, texture) >= material.alpha_cutoff:
        return replace(material, alpha_mode="opaque", opacity=1.0)
    return material


def _least_opacity(material: Material, texture: Texture | None) -> float:
    if texture is None or texture.opacity is None:
        return material.opacity
    return material.opacity * int(texture.opacity.min()) / 255.0
