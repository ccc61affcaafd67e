"""A view as fits see it: a subset of its pixels, and the reduced least-squares problem made of them."""

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
"""Most pixels of a view that a fit uses, to bound its memory. A choice: a 64×48 view has fewer."""
TILES = 2
"""Tiles along either side of a view, within which errors count as correlated (`tuner.fitting.uncertainty`). A
choice."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FitView:
    """One view, ready to be fitted."""

    table: TabulatedGather
    target: Target
    reduced: ReducedGather
    """The reduced problem of `table` and `target`."""
    tile: Int[Array, " receivers"]
    """The view's tile that each receiver lies in, in [0, `TILES`²)."""


@dataclass(frozen=True, eq=False)
class ViewPixels:
    """The pixels of one view that a fit uses, as receivers; lengths in units of L."""

    receivers: Receivers
    vpls: VirtualPointLights
    overlap: Float[Array, "receivers vpls"] | None
    """From the visibility maps (`tuner.surrogate.vpl_visibility.surface_overlap`); None without maps."""
    visibility: Visibility | None
    """Share of each VPL's light that reaches each receiver, in [0, 1], if it was given in place of maps."""
    half_a: Float32[np.ndarray, "receivers 3"]
    half_b: Float32[np.ndarray, "receivers 3"]
    """Indirect irradiance by the two halves of the reference [W/m²]."""
    pixels: Int[np.ndarray, " receivers"]
    """Index of each receiver's pixel in the image, row by row."""
    size: tuple[int, int]
    """Width and height of the image, in pixels."""

    def table(self, parameters: ArtistParameters) -> TabulatedGather:
        """The gather, tabulated with the visibility that the maps give for these parameters."""
        seen = self.visibility
        if self.overlap is not None:
            seen = seen_share(self.overlap, VisibilityParameters.of(parameters))
        return tabulate_gather(self.receivers, self.vpls, seen)

    def ready(self, table: TabulatedGather, weight: Float[np.ndarray, "receivers 3"] | None) -> FitView:
        """The view with its reduced problem; `weight` None takes the weights of relMSE."""
        return fit_view_of_table(table, target_of(self.half_a, self.half_b, weight), self.pixels, self.size)


def view_pixels(
    view: CapturedView, visibility: Bool[np.ndarray, "pixels vpls"] | None = None, *, seed: int = 0
) -> ViewPixels:
    """Select the pixels of a view that a fit uses.

    Args:
        view: a captured view.
        visibility: whether each VPL is visible from each pixel in which the runtime sees a surface. None uses
            the view's visibility maps; without these, all VPLs are visible.
        seed: selects pixels where there are more than `RECEIVERS_PER_VIEW`.
    """
    values = view.pixel_values(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, values.chosen)
    maps, overlap = view.captured.visibility_maps, None
    if maps is not None and visibility is None:
        overlap = surface_overlap(receivers, vpls, map_texels(maps))
    # Floats, as maps give: one compiled gather then serves both.
    known = None if visibility is None else jnp.asarray(visibility[values.chosen], jnp.float32)
    halves = values.half_a, values.half_b
    return ViewPixels(receivers, vpls, overlap, known, *halves, values.flat, view.view.size)


def robust_errors(views: Sequence[CapturedView], *, seed: int = 0) -> tuple[RobustError, ...]:
    """The robust error of each view; its scale comes from the image that the view was captured with.

    Args:
        views: captured with the parameters that a fit starts from.
        seed: selects pixels; must be that of `view_pixels`.
    """
    values = [view.pixel_values(RECEIVERS_PER_VIEW, seed) for view in views]
    return tuple(robust_error(each.reference, each.direct, each.drawn) for each in values)


def drawn_cost(view: CapturedView, error: RobustError, *, seed: int = 0) -> float:
    """The robust error of the image that a view was captured with; `seed` as in `robust_errors`."""
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
    """One view with the weights of relMSE; the arguments are fields of `ViewPixels`."""
    table = tabulate_gather(receivers, vpls, visibility)
    return fit_view_of_table(table, target_of(half_a, half_b), pixels, size)


def fit_view_of_table(
    table: TabulatedGather, target: Target, pixels: Int[np.ndarray, " receivers"], size: tuple[int, int]
) -> FitView:
    """One view from its tabulated gather and its target; `pixels` and `size` are fields of `ViewPixels`."""
    row, column = np.divmod(pixels, size[0])
    tile = (row * TILES // size[1]) * TILES + column * TILES // size[0]
    return FitView(table, target, reduce_gather(table, target), jnp.asarray(tile, jnp.int32))


def reweighted(view: FitView, error: RobustError, image: Float[np.ndarray, "receivers 3"]) -> FitView:
    """The view with the weights of the next reweighting step, from the errors of `image` [W/m²]."""
    weight = jnp.asarray(error.weights(image), jnp.float32)
    target = replace(view.target, weight=weight)
    return replace(view, target=target, reduced=reduce_gather(view.table, target))
