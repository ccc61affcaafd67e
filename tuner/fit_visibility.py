"""Fits bias and softness of visibility maps: they act on a pair of receiver and VPL through one number.

That number is the overlap of `tuner.vpl_visibility.surface_overlap`. With the falloff held, each receiver's
VPLs are summed once over a grid of overlaps; irradiance is then a matrix product of these sums with the share
that is seen at each overlap, and a step costs next to nothing (`tuner.reduced_gather`). Falloff and
visibility are fitted in turns.

What is minimised is relMSE alone: maps have no way to pay for leaks by dimming the picture, which is why a
falloff's fit adds plain squared error, and a few dark pixels are what tells leaks from light. With that
addition, or a quarter of the pixels, fits of two rooms left two to three times the error of none at all.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from renderer.artist_parameters import ArtistParameters
from tuner.captured_view import CapturedView
from tuner.descent import descend
from tuner.fit_falloff import fit_to
from tuner.fit_status import Descent
from tuner.fit_views import RECEIVERS_PER_VIEW, FitView, fit_view
from tuner.losses.relative_squared_error import EVEN_SHARE, target_of
from tuner.reduced_gather import reduce_columns
from tuner.search_space import VISIBILITY_SPECS, SearchSpace
from tuner.virtual_point_lights import Receivers, VirtualPointLights, gather_inputs
from tuner.vpl_gather import FalloffParameters, pair_forms, receivers_at_once, vpl_axes
from tuner.vpl_visibility import VisibilityParameters, map_texels, seen_share, surface_overlap
from tuner.wide_vectors import wide_jit

TURNS = 2
STARTS = 9
"""Along each axis of the grid from whose best point a descent begins."""
NODES = 96
"""Of the grid, geometric in the overlap, each a tenth above the one before: half as many miss planted values
by a tenth."""
PAIRS_AT_ONCE = 2**13
"""Receivers times VPLs that are summed in one go: what these share out between the nodes is 3 MiB."""
_LEAST = VISIBILITY_SPECS[0].low
_MOST = sum(spec.high for spec in VISIBILITY_SPECS)

SPACE = SearchSpace(VISIBILITY_SPECS)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ReducedVisibility:
    """One view with its falloff held. |factor · (1, seen at the nodes) − target|² + offset is its loss."""

    factor: Float[Array, "rows columns"]
    target: Float[Array, " rows"]
    offset: Float[Array, ""]


@dataclass(frozen=True, eq=False)
class _View:
    receivers: Receivers
    vpls: VirtualPointLights
    overlap: Float[Array, "receivers vpls"]
    halves: tuple[np.ndarray, np.ndarray]
    pixels: np.ndarray
    size: tuple[int, int]


def fit_visibility(
    views: tuple[CapturedView, ...], start: ArtistParameters, *, seed: int = 0
) -> tuple[ArtistParameters, Descent | None]:
    """`start` with the bias and softness that bring the views closest to their references.

    Args:
        views: what to fit to, captured with visibility maps.
        start: where to begin; what else it holds is kept, though the falloff is refitted on the way.
        seed: of the choice of pixels.

    Returns:
        The parameters, and the last turn's descent; None where nothing is lit.
    """
    chosen = _views_of(views, seed)
    current, descent = start, None
    for _ in range(TURNS):
        current, falloff = fit_to(_ready(chosen, current), current)
        if falloff.status.nothing_fitted:
            return start, None
        current, descent = fit_visibility_to(_reduced(chosen, current), current)
    found = {spec.name: getattr(current, spec.name) for spec in VISIBILITY_SPECS}
    return replace(start, **found), descent


def fit_falloff_and_visibility(
    views: tuple[CapturedView, ...],
    start: ArtistParameters,
    *,
    seed: int = 0,
    even_share: float = EVEN_SHARE,
) -> tuple[ArtistParameters, Descent]:
    """The falloff, bias and softness at it, and the falloff once more: all in one turn.

    Args:
        views: what to fit to, captured with visibility maps.
        start: where to begin, and what the other parameters stay at.
        seed: of the choice of pixels.
        even_share: of the falloff's loss, see `tuner.losses`.
    """
    chosen = _views_of(views, seed)
    parameters, descent = fit_to(_ready(chosen, start, even_share), start)
    if descent.status.nothing_fitted:
        return start, descent
    seen, _ = fit_visibility_to(_reduced(chosen, parameters), parameters)
    refitted = fit_to(_ready(chosen, seen, even_share), seen)
    # Maps are fitted to relMSE alone, and may be worse by the other share.
    return min((parameters, descent), refitted, key=lambda fit: fit[1].loss)


def fit_visibility_to(
    views: tuple[ReducedVisibility, ...], start: ArtistParameters
) -> tuple[ArtistParameters, Descent]:
    """Bias and softness for views whose falloff is held.

    The descent begins at the best of `start` and a grid: few pairs overlap by a little, so far from the best
    place the loss is all but flat.
    """
    offset = float(sum(view.offset for view in views)) / len(views)
    side = np.linspace(0.0, 1.0, STARTS)
    grid = np.stack(np.meshgrid(*[side] * len(VISIBILITY_SPECS)), axis=-1).reshape(-1, len(VISIBILITY_SPECS))
    points = np.concatenate([SPACE.point(start)[None], grid]).astype(np.float32)
    best = points[int(np.argmin(_squares(jnp.asarray(points), views)))]
    descent = descend(residuals, views, best, offset=offset)
    return SPACE.parameters(descent.point, start), descent


@jax.jit
def _squares(
    points: Float[Array, "points parameters"], views: tuple[ReducedVisibility, ...]
) -> Float[Array, " points"]:
    return jax.lax.map(lambda point: jnp.sum(residuals(point, views) ** 2), points)


def residuals(
    point: Float[Array, " parameters"], views: tuple[ReducedVisibility, ...]
) -> Float[Array, " rows"]:
    """Of all views, each counting the same, at a point of the unit cube."""
    values = SPACE.values(point)
    parameters = VisibilityParameters(values["visibility_bias"], values["visibility_softness"])
    seen = jnp.concatenate([jnp.ones(1), seen_share(jnp.asarray(overlap_nodes()), parameters)])
    pictures = [jnp.matmul(view.factor, seen, precision="highest") - view.target for view in views]
    return jnp.concatenate(pictures) / np.sqrt(len(views))


def overlap_nodes() -> Float[np.ndarray, " nodes"]:
    """The grid: below its first node all is seen, beyond its last nothing, whatever the parameters."""
    return np.geomspace(_LEAST, _MOST, NODES).astype(np.float32)


def reduce_visibility(
    receivers: Receivers,
    vpls: VirtualPointLights,
    overlap: Float[Array, "receivers vpls"],
    halves: tuple[np.ndarray, np.ndarray],
    falloff: FalloffParameters,
) -> ReducedVisibility:
    """The small problem of one view for the falloff given; `halves` of the reference at the receivers."""
    sums = _sums(receivers, vpls, overlap, falloff)
    return ReducedVisibility(*reduce_columns(sums, target_of(*halves, even_share=0.0)))


def _view_of(view: CapturedView, seed: int) -> _View:
    maps = view.captured.visibility_maps
    assert maps is not None, "the views were captured without visibility maps"
    chosen = view.fitted_pixels(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, chosen)
    pixels = np.flatnonzero(view.captured.valid.ravel())[chosen]
    half_a, half_b = (
        half.reshape(-1, 3)[pixels] for half in (view.reference.irradiance_a, view.reference.irradiance_b)
    )
    overlap = surface_overlap(receivers, vpls, map_texels(maps))
    return _View(receivers, vpls, overlap, (half_a, half_b), pixels, view.view.size)


def _views_of(views: tuple[CapturedView, ...], seed: int) -> list[_View]:
    return [_view_of(view, seed + index) for index, view in enumerate(views)]


def _ready(
    views: list[_View], parameters: ArtistParameters, even_share: float = EVEN_SHARE
) -> tuple[FitView, ...]:
    visibility = VisibilityParameters.of(parameters)
    return tuple(
        fit_view(
            view.receivers,
            view.vpls,
            seen_share(view.overlap, visibility),
            *view.halves,
            view.pixels,
            view.size,
            even_share,
        )
        for view in views
    )


def _reduced(views: list[_View], parameters: ArtistParameters) -> tuple[ReducedVisibility, ...]:
    falloff = FalloffParameters.of(parameters)
    return tuple(
        reduce_visibility(view.receivers, view.vpls, view.overlap, view.halves, falloff) for view in views
    )


@wide_jit
def _sums(
    receivers: Receivers,
    vpls: VirtualPointLights,
    overlap: Float[Array, "receivers vpls"],
    falloff: FalloffParameters,
) -> Float[Array, "receivers 3 columns"]:
    """What is always seen, then what is shared out between the nodes, linearly in the logarithm.

    As one product for each receiver, which is sooner than a pass over all pairs for each node.
    """
    count = receivers.position.shape[0]
    chunk_size = min(receivers_at_once(vpls.position.shape[0], PAIRS_AT_ONCE), max(count, 1))
    padding = ((0, -count % chunk_size), (0, 0))
    axes = vpl_axes(vpls)
    step = np.log(_MOST / _LEAST) / (NODES - 1)
    columns = jnp.arange(-1.0, NODES)

    def chunked(values: Array) -> Array:
        return jnp.pad(values, padding).reshape(-1, chunk_size, values.shape[1])

    def of_chunk(chunk: tuple[Array, Array, Array]) -> Float[Array, "chunk 3 columns"]:
        position, normal, overlap = chunk
        squared, form_at = pair_forms(Receivers(position, normal), vpls, axes)
        transmittance = jnp.exp(-falloff.falloff_transmittance * jnp.sqrt(squared))
        form = falloff.intensity / jnp.pi * form_at(falloff.falloff_footprint) * transmittance
        # Along the nodes, from 0; what is always seen lies on a place of its own.
        place = jnp.where(overlap > _LEAST, jnp.log(jnp.maximum(overlap, _LEAST) / _LEAST) / step, -1.0)
        share = jnp.maximum(1.0 - jnp.abs(place[:, :, None] - columns), 0.0)
        return jnp.matmul(form[:, None, :] * vpls.flux.T, share, precision="highest")

    sums = jax.lax.map(of_chunk, tuple(map(chunked, (receivers.position, receivers.normal, overlap))))
    return sums.reshape(-1, *sums.shape[2:])[:count]
