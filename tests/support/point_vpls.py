"""VPLs drawn as points, where the default is clustered disc lights."""

from typing import Any

from vpltune.renderer.config.artist_parameters import ArtistParameters


def point_vpls(**changes: Any) -> ArtistParameters:
    """Parameters of 1,024 points placed by flux alone, with some of them changed.

    They are the defaults of version 1. α = 0.5 suits points as 1 suits discs.
    """
    points = {
        "vpl_count": 1024,
        "falloff_footprint": 0.5,
        "density_importance": 0.0,
        "lloyd_iterations": 0,
    }
    return ArtistParameters(**{**points, **changes})
