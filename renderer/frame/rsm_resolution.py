"""How many texels an RSM face has."""

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.scene.light_faces import face_count
from vpltune.renderer.scene.scene import Light

RSM_RESOLUTION = 1024
"""Texels along the side of a face. Shadows come from the same map, which sets the number."""
RSM_RESOLUTION_OF_MANY = 512
"""The same with more than `FEW_FACES`: a point light has six."""
FEW_FACES = 2
"""Faces up to which each has the full resolution; those of a sun count as one. A choice: two lamps, or a lamp
and a sun."""


def rsm_resolution(lights: tuple[Light, ...], quality: Quality | None = None) -> int:
    """Texels along the side of each face of these lights: what `quality` says, else by their number."""
    if quality is not None and quality.rsm_resolution is not None:
        return quality.rsm_resolution
    return RSM_RESOLUTION if face_count(lights, nested_faces=0) <= FEW_FACES else RSM_RESOLUTION_OF_MANY
