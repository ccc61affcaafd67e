"""Light from far away all around a scene: a sky, or a photographed environment."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64


@dataclass(frozen=True, eq=False)
class Environment:
    """The radiance that arrives from each direction, as an equirectangular map in the world's axes.

    The map's columns run with the azimuth, the angle from −Z towards +X, its rows with the polar angle, from
    +Y in row 0 to −Y in the last. Within a texel the radiance is even.
    """

    radiance: Float32[np.ndarray, "height width 3"]
    """RGB in W/(m² sr), each finite and ≥ 0. An even sky has one texel."""

    def __repr__(self) -> str:
        height, width, _ = self.radiance.shape
        return f"Environment({width}×{height}, mean {self.mean_radiance().mean():.4g} W/(m² sr))"

    def mean_radiance(self) -> Float64[np.ndarray, "3"]:
        """The mean over all directions, RGB in W/(m² sr)."""
        return np.einsum(
            "hwc,h->c", self.radiance.astype(np.float64), solid_angles(*self.radiance.shape[:2])
        ) / (4.0 * np.pi)


def even_sky(radiance: tuple[float, float, float]) -> Environment:
    """The environment that has the same radiance, RGB in W/(m² sr), in all directions."""
    return Environment(np.array(radiance, np.float32).reshape(1, 1, 3))


def solid_angles(height: int, width: int) -> Float64[np.ndarray, " height"]:
    """The solid angle in sr of a texel in each row of a map of `height` rows and `width` columns."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * (2.0 * np.pi / width)


def texel_directions(height: int, width: int) -> Float64[np.ndarray, "height width 3"]:
    """Unit vectors from the scene towards the middle of each texel of a map."""
    polar = np.pi * (np.arange(height) + 0.5) / height
    azimuth = 2.0 * np.pi * (np.arange(width) + 0.5) / width
    directions = np.empty((height, width, 3))
    directions[..., 0] = np.outer(np.sin(polar), np.sin(azimuth))
    directions[..., 1] = np.cos(polar)[:, None]
    directions[..., 2] = -np.outer(np.sin(polar), np.cos(azimuth))
    return directions
