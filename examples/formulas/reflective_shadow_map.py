"""What one texel of a reflective shadow map stands for: docs/runtime_formulas.md, "RSM texels" and "L".

Arrays of one face are [row, column, …]; row 0 is the bottom of the face.
"""

from dataclasses import dataclass

import numpy as np

from examples.formulas.vectors import dot, length

MIN_COSINE = 0.02


@dataclass(frozen=True)
class RsmTexels:
    """Texels of one face."""

    flux: np.ndarray
    """[row, column, 3] reflected radiant flux [W]; 0 where nothing is lit."""
    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    """Area of the surface [world units²]."""

    @property
    def mean_flux(self) -> np.ndarray:
        """One number for three channels: their mean."""
        return self.flux.mean(axis=-1)


def texel_rays(face: dict, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of the light's rays through places [texels], where a ray has unit depth.

    (0, 0) is the lower left corner of the face; a texel's centre is its column and row plus ½.
    """
    ndc = places * (2.0 / face["resolution"]) - 1.0
    to_world = np.asarray(face["light_to_world"])
    right, up, back, origin = to_world[:3].T
    across = ndc[..., :1] * face["extent"][0] * right + ndc[..., 1:] * face["extent"][1] * up
    if face["orthographic"]:
        return origin + across, np.broadcast_to(-back, across.shape)
    return np.broadcast_to(origin, across.shape), across - back


def texel_centers(resolution: int) -> np.ndarray:
    column, row = np.meshgrid(np.arange(resolution), np.arange(resolution))
    return np.stack([column, row], axis=-1) + 0.5


def stored_depth(face: dict, view_depth: np.ndarray) -> np.ndarray:
    """Reversed depth, 1 at the near plane; 0 is kept for texels that see nothing."""
    if face["orthographic"]:
        return 1.0 - view_depth / face["near_or_range"]
    return face["near_or_range"] / view_depth


def rsm_texels(
    light: dict, face: dict, depth: np.ndarray, normal: np.ndarray, reflectance: np.ndarray
) -> RsmTexels:
    """Texels from what the RSM pass stores.

    Args:
        light: its intensity is used; cone and range are part of the reflectance.
        face: as `punctual_lights.light_faces` gives it, with its `resolution`.
        depth: [row, column] as `stored_depth`; 0 where nothing is hit.
        normal: [row, column, 3] of the true plane, on the lit side.
        reflectance: [row, column, 3] albedo · cone falloff · ratio of shading to geometric cosine.
    """
    origin, ray = texel_rays(face, texel_centers(face["resolution"]))
    hit = depth > 0.0
    safe = np.where(hit, depth, 1.0)
    near_or_range = face["near_or_range"]
    view_depth = (1.0 - safe) * near_or_range if face["orthographic"] else near_or_range / safe
    side = np.asarray(face["extent"]) * (2.0 / face["resolution"])
    ray_length = length(ray)  # 1 for an orthographic face
    # Solid angle of the texel [sr]; of an orthographic face, its area across the beam.
    measure = side[0] * side[1] / ray_length**3
    across = measure * (1.0 if face["orthographic"] else (ray_length * view_depth) ** 2)
    cosine = dot(normal, -ray / ray_length[..., None])
    area = across / np.maximum(cosine, MIN_COSINE)
    flux = np.asarray(light["intensity"]) * reflectance * measure[..., None]
    position = origin + ray * view_depth[..., None]
    return RsmTexels(
        np.where(hit[..., None], flux, 0.0),
        np.where(hit[..., None], position, 0.0),
        np.where(hit[..., None], normal, [0.0, 0.0, 1.0]),
        np.where(hit, area, 0.0),
    )


def scene_length(faces: list[RsmTexels]) -> float:
    """L: the flux-weighted standard deviation of the positions of all lit texels of all faces."""
    flux = np.concatenate([texels.mean_flux.ravel() for texels in faces])
    position = np.concatenate([texels.position.reshape(-1, 3) for texels in faces])
    if not flux.sum() > 0.0:
        return 1.0
    center = (flux[:, None] * position).sum(axis=0) / flux.sum()
    return float(np.sqrt((flux * dot(position - center, position - center)).sum() / flux.sum()))
