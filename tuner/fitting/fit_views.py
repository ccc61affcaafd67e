"""A view as a fit works on it: the pixels that it looks at, and the small problem made of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.metrics.relative_squared_error import Target, target_of
from vpltune.tuner.metrics.robust_error import RobustError, robust_error
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.reduced_gather import ReducedGather, reduce_gather
from vpltune.tuner.surrogate.tabulated_gather import TabulatedGather, Visibility, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights, gather_inputs
from vpltune.tuner.surrogate.vpl_visibility import (
    VisibilityParameters,
    map_texels,
    seen_share,
    surface_overlap,
)

RECEIVERS_PER_VIEW = 4096
"""The most pixels of a view that a fit looks at: all of a 64×48 one, and memory stays bounded."""
TILES = 2
"""Tiles along either side of a view: the pixels of a tile are taken to err together, see
`tuner.fitting.uncertainty`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FitView:
    """One view, ready to be fitted."""

    table: TabulatedGather
    target: Target
    reduced: ReducedGather
    tile: Int[Array, " receivers"]
    """Which of the view's TILES² tiles a receiver lies in."""


@dataclass(frozen=True, eq=False)
class ViewPixels:
    """The receivers that a fit looks at in one view, lengths in units of L."""

    receivers: Receivers
    vpls: VirtualPointLights
    overlap: Float[Array, "receivers vpls"] | None
    """What the visibility maps say, see `tuner.surrogate.vpl_visibility.surface_overlap`; None without maps."""
    visibility: Visibility | None
    """Share of each VPL's light that reaches each receiver where that is known; takes the place of the
    maps."""
    half_a: Float32[np.ndarray, "receivers 3"]
    half_b: Float32[np.ndarray, "receivers 3"]
    """The reference's halves [W/m²]."""
    pixels: Int[np.ndarray, " receivers"]
    """Where the receivers lie in the image, counted row by row."""
    size: tuple[int, int]
    """Width and height of the image."""

    def table(self, parameters: ArtistParameters) -> TabulatedGather:
        """The gather tabulated with the visibility that `parameters` make of the maps."""
        seen = self.visibility
        if self.overlap is not None:
            seen = seen_share(self.overlap, VisibilityParameters.of(parameters))
        return tabulate_gather(self.receivers, self.vpls, seen)

    def ready(self, table: TabulatedGather, weight: Float[np.ndarray, "receivers 3"] | None) -> FitView:
        """The small problem with these weights; None takes those of relMSE."""
        return fit_view_of_table(table, target_of(self.half_a, self.half_b, weight), self.pixels, self.size)


def view_pixels(
    view: CapturedView, visibility: Bool[np.ndarray, "pixels vpls"] | None = None, *, seed: int = 0
) -> ViewPixels:
    """The pixels that a fit looks at.

    Args:
        visibility: of every pixel that the runtime sees a surface in, and every VPL; None takes what the
            runtime itself knows of it, from the view's visibility maps where it has them.
        seed: of the choice of pixels, where there are more than `RECEIVERS_PER_VIEW`.
    """
    values = view.pixel_values(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, values.chosen)
    maps, overlap = view.captured.visibility_maps, None
    if maps is not None and visibility is None:
        overlap = surface_overlap(receivers, vpls, map_texels(maps))
    # As numbers, which a view with maps has too: one compiled gather serves both.
    known = None if visibility is None else jnp.asarray(visibility[values.chosen], jnp.float32)
    halves = values.half_a, values.half_b
    return ViewPixels(receivers, vpls, overlap, known, *halves, values.flat, view.view.size)


def robust_errors(views: Sequence[CapturedView], *, seed: int = 0) -> tuple[RobustError, ...]:
    """How the errors of each view count, scaled by those of the image that it was captured with.

    Args:
        seed: of the choice of pixels; the same as that of `view_pixels`.
    """
    values = [view.pixel_values(RECEIVERS_PER_VIEW, seed) for view in views]
    return tuple(robust_error(each.reference, each.direct, each.drawn) for each in values)


def drawn_cost(view: CapturedView, error: RobustError, *, seed: int = 0) -> float:
    """The cost of the image that a view was captured with."""
    return error.cost(view.pixel_values(RECEIVERS_PER_VIEW, seed).drawn)


def fit_view(
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None,
    half_a: Float32[np.ndarray, "receivers 3"],
    half_b: Float32[np.ndarray, "receivers 3"],
    pixels: Int[np.ndarray, " receivers"],
    size: tuple[int, int],
) -> FitView:
    """One view with the weights of relMSE; arguments as the fields of `ViewPixels`."""
    table = tabulate_gather(receivers, vpls, visibility)
    return fit_view_of_table(table, target_of(half_a, half_b), pixels, size)


def fit_view_of_table(
    table: TabulatedGather, target: Target, pixels: Int[np.ndarray, " receivers"], size: tuple[int, int]
) -> FitView:
    """One view from its tabulated gather and its target."""
    row, column = np.divmod(pixels, size[0])
    tile = (row * TILES // size[1]) * TILES + column * TILES // size[0]
    return FitView(table, target, reduce_gather(table, target), jnp.asarray(tile, jnp.int32))


def reweighted(view: FitView, error: RobustError, image: Float[np.ndarray, "receivers 3"]) -> FitView:
    """The same view with the weights that the errors of an image ask for: the next step of a robust fit."""
    weight = jnp.asarray(error.weights(image), jnp.float32)
    target = replace(view.target, weight=weight)
    return replace(view, target=target, reduced=reduce_gather(view.table, target))
