"""Irradiance from an even polygon, in closed form."""

import numpy as np
from jaxtyping import Float


def polygon_irradiance(
    corners: Float[np.ndarray, "corners 3"],
    points: Float[np.ndarray, "*points 3"],
    normal: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "*points"]:
    """E ÷ L of an even polygon over the horizon of each point.

    Lambert (1760); Baum et al. (1989), "Improving Radiosity Solutions Through the Use of Analytically
    Determined Form-Factors", eq. 6.
    """
    rays = corners - points[..., None, :]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    following = np.roll(rays, -1, axis=-2)
    across = np.cross(rays, following)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    angles = np.arctan2(length, (rays * following).sum(axis=-1, keepdims=True))
    return np.abs(((across / length * angles) @ normal).sum(axis=-1)) / 2.0
