"""What the readers do with alpha: materials whose alpha changes nothing are opaque, and others get a word.

Many files ask for an alpha mode everywhere.
"""

from dataclasses import replace

from vpltune.renderer.scene.files.diagnostics import Warnings
from vpltune.renderer.scene.scene import Material, Texture

OPAQUE = 1.0 - 0.5 / 255.0
"""Half a step of eight bits below 1: a blended surface this opaque is opaque."""


def without_idle_alpha(material: Material, texture: Texture | None) -> Material:
    """The material, opaque where no point of it falls below its cutoff, or below 1 if it is blended.

    Args:
        material: in any alpha mode.
        texture: its texture, if any.
    """
    if material.is_opaque:
        return material
    if _least_opacity(material, texture) >= (OPAQUE if material.is_blended else material.alpha_cutoff):
        return replace(material, alpha_mode="opaque", opacity=1.0)
    return material


def say_blended(material: Material, warnings: Warnings) -> None:
    """Say how a material is drawn if it is blended."""
    if material.is_blended:
        warnings.tally(
            "1 material is see-through: light passes by its share, the camera sees it if half opaque or more",
            "{n} materials are see-through: light passes by their shares, the camera sees them if half "
            "opaque or more",
        )


def _least_opacity(material: Material, texture: Texture | None) -> float:
    if texture is None or texture.opacity is None:
        return material.opacity
    return material.opacity * int(texture.opacity.min()) / 255.0
