"""How many texels an RSM face has."""

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.light_faces import face_count
from vpltune.renderer.scene.scene import Light

RSM_RESOLUTION = 1024
"""Texels along the side of a face. Shadows come from the same map, which sets the number."""
RSM_RESOLUTION_OF_MANY = 512
"""The same with more than `FEW_FACES`: a point light has six."""
FEW_FACES = 2
"""Faces up to which each has the full resolution; those of a sun count as one. A choice: two lamps, or a lamp
and a sun."""
MOST_TEXELS = 1 << 25
"""Texels of all faces, beyond which each has half as many along its side, and so on. A choice: half a GB."""
LEAST_RESOLUTION = 64
"""Where that ends. A choice: a shadow is still a shadow, and each cell of the importance has some texels."""
MOST_FACES = MOST_TEXELS // LEAST_RESOLUTION**2
"""Faces that there is room for: 1,365 point lights."""


def rsm_resolution(lights: tuple[Light, ...], quality: Quality | None = None, sky_lights: int = 0) -> int:
    """Texels along the side of each face of these lights: what `quality` says, else by their number.

    `sky_lights` is how many lights of one face there are besides, for the sky.

    Raises:
        InputError: there are more than `MOST_FACES`.
    """
    count = face_count(lights, nested_faces=0) + sky_lights
    if count > MOST_FACES:
        raise InputError(
            f"lights: must have at most {MOST_FACES:,} shadow map faces, got {len(lights):,} lights with "
            f"{count:,} (a point light has 6, a spot 1 or 5)"
        )
    if quality is not None and quality.rsm_resolution is not None:
        return quality.rsm_resolution
    if count <= FEW_FACES:
        return RSM_RESOLUTION
    resolution = RSM_RESOLUTION_OF_MANY
    while count * resolution**2 > MOST_TEXELS:
        resolution //= 2
    return resolution
