"""A view as the fit works on it: the gather tabulated, and the reference at the chosen receivers."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Int

from renderer.artist_parameters import ArtistParameters
from tuner.captured_view import CapturedView
from tuner.losses.relative_squared_error import EVEN_SHARE, Target, target_of
from tuner.reduced_gather import ReducedGather, reduce_gather
from tuner.tabulated_gather import TabulatedGather, Visibility, tabulate_gather
from tuner.virtual_point_lights import Receivers, VirtualPointLights, gather_inputs
from tuner.vpl_visibility import map_visibility

RECEIVERS_PER_VIEW = 4096
"""Pixels of each view that the fit looks at: three parameters need no more, and memory stays bounded."""
TILES = 2
"""Along either side of a view: pixels of a tile are taken to err together, see `tuner.uncertainty`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FitView:
    """One view, ready to be fitted."""

    table: TabulatedGather
    target: Target
    reduced: ReducedGather
    tile: Int[Array, " receivers"]
    """Which of the view's TILES² tiles a receiver lies in."""


def fit_view(
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None,
    half_a: Float32[np.ndarray, "receivers 3"],
    half_b: Float32[np.ndarray, "receivers 3"],
    pixels: Int[np.ndarray, " receivers"],
    size: tuple[int, int],
    even_share: float = EVEN_SHARE,
) -> FitView:
    """From what stands in a view.

    Args:
        receivers, vpls: in units of L.
        visibility: share of each VPL's light that reaches each receiver; None for all of it.
        half_a, half_b: of the reference at the receivers, W/m².
        pixels: where the receivers lie in the picture, counted row by row.
        size: width and height of the picture.
    """
    table = tabulate_gather(receivers, vpls, visibility)
    target = target_of(half_a, half_b, even_share)
    row, column = np.divmod(pixels, size[0])
    tile = (row * TILES // size[1]) * TILES + column * TILES // size[0]
    return FitView(table, target, reduce_gather(table, target), jnp.asarray(tile, jnp.int32))


def fit_view_of(
    view: CapturedView,
    parameters: ArtistParameters,
    visibility: Bool[np.ndarray, "pixels vpls"] | None = None,
    *,
    seed: int = 0,
    even_share: float = EVEN_SHARE,
) -> FitView:
    """From a captured view.

    Args:
        parameters: those that are not fitted: bias and softness of visibility maps.
        visibility: of every valid pixel and VPL; None takes what the runtime itself knows of it, from the
            view's visibility maps where it has them.
        seed: of the choice of pixels.
    """
    chosen = view.fitted_pixels(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, chosen)
    if visibility is None:
        seen = map_visibility(view.captured, receivers, vpls, parameters)
    else:
        seen = visibility[chosen]
    pixels = np.flatnonzero(view.captured.valid.ravel())[chosen]
    halves = (
        half.reshape(-1, 3)[pixels] for half in (view.reference.irradiance_a, view.reference.irradiance_b)
    )
    return fit_view(receivers, vpls, seen, *halves, pixels, view.view.size, even_share)
