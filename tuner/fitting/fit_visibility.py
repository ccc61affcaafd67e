"""Fits bias β and softness σ of the visibility maps.

Both act on a pair of receiver and VPL through one number, the overlap of
`tuner.surrogate.vpl_visibility.surface_overlap`. With the falloff held, each receiver's VPLs are binned once
by overlap. Irradiance is then the product of these sums with the visible share at each bin, and the reduced
problem (`tuner.surrogate.reduced_gather`) makes a step cost microseconds. `tuner.fitting.fit_placement`
alternates between falloff and visibility.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.descent import descend
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import ViewPixels
from vpltune.tuner.fitting.search_space import VISIBILITY_SPECS, SearchSpace
from vpltune.tuner.metrics.relative_squared_error import Target
from vpltune.tuner.surrogate.receiver_chunks import map_receivers
from vpltune.tuner.surrogate.reduced_gather import reduce_columns
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, pair_forms, vpl_axes
from vpltune.tuner.surrogate.vpl_visibility import VisibilityParameters, seen_share
from vpltune.tuner.surrogate.wide_vectors import wide_jit

LEAST_GAIN = 0.02
"""Least relative fall of the loss for which bias and softness move. A choice: without it they wandered over a
flat loss, and raised the held-out relMSE of one development scene to 1.8 times."""
AT_BOUND = 1e-3
"""Distance from a bound, as a share of the range, below which a parameter counts as at it. A choice."""
STARTS = 9
"""Points along each axis of the grid whose best one the descent starts from. A choice."""
NODES = 96
"""Nodes of the overlap grid, each about a tenth above the one before. With half as many, planted values are
missed by a tenth."""
PAIRS_AT_ONCE = 2**13
"""Pairs of receiver and VPL in a chunk: their weights at all nodes take 3 MiB."""
# Overlap of the first node, the least bias, and of the last, the largest bias plus the largest softness.
_LEAST = VISIBILITY_SPECS[0].low
_MOST = sum(spec.high for spec in VISIBILITY_SPECS)

SPACE = SearchSpace(VISIBILITY_SPECS)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ReducedVisibility:
    """The reduced problem of one view with its falloff held.

    With v the visible share at the nodes, the loss of the view is |factor · (1, v) − target|² + offset.
    """

    factor: Float[Array, "rows columns"]
    target: Float[Array, " rows"]
    offset: Float[Array, ""]


def fit_maps(
    pixels: Sequence[ViewPixels], targets: Sequence[Target], start: ArtistParameters
) -> ArtistParameters:
    """Fit bias and softness with the falloff of `start` held.

    Both keep the start's values if moving them lowers the loss by less than `LEAST_GAIN`, or drives one of
    them to a bound of its range: the views do not determine them then.

    Args:
        pixels: the fitted pixels of each view; a view without maps is left out.
        targets: their references and weights.
        start: falloff, and where the fit begins.
    """
    falloff = FalloffParameters.of(start)
    reduced = tuple(
        reduce_visibility(view.receivers, view.vpls, view.overlap, target, falloff)
        for view, target in zip(pixels, targets, strict=True)
        if view.overlap is not None
    )
    found, descent = fit_visibility_to(reduced, start)
    here = jnp.asarray(SPACE.point(start), jnp.float32)[None]
    before = float(_squares(here, reduced)[0]) + float(sum(view.offset for view in reduced)) / len(reduced)
    inside = (descent.point > AT_BOUND).all() and (descent.point < 1.0 - AT_BOUND).all()
    return found if inside and before - descent.loss > LEAST_GAIN * abs(before) else start


def fit_visibility_to(
    views: tuple[ReducedVisibility, ...], start: ArtistParameters
) -> tuple[ArtistParameters, Descent]:
    """Fit bias and softness to reduced views.

    The descent begins at the best point of `start` and a grid. Few pairs have a small overlap, so far from
    the optimum the loss is almost flat.
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
    """Residuals of all views, which count the same, at a point of the unit cube of `SPACE`."""
    values = SPACE.values(point)
    parameters = VisibilityParameters(values["visibility_bias"], values["visibility_softness"])
    seen = jnp.concatenate([jnp.ones(1), seen_share(jnp.asarray(overlap_nodes()), parameters)])
    images = [jnp.matmul(view.factor, seen, precision="highest") - view.target for view in views]
    return jnp.concatenate(images) / np.sqrt(len(views))


def overlap_nodes() -> Float[np.ndarray, " nodes"]:
    """The overlap grid. For any bias and softness in range, pairs below the first node are fully visible and
    pairs beyond the last are not visible at all."""
    return np.geomspace(_LEAST, _MOST, NODES).astype(np.float32)


def reduce_visibility(
    receivers: Receivers,
    vpls: VirtualPointLights,
    overlap: Float[Array, "receivers vpls"],
    target: Target,
    falloff: FalloffParameters,
) -> ReducedVisibility:
    """The reduced problem of one view for a given falloff; lengths in units of L."""
    return ReducedVisibility(*reduce_columns(_sums(receivers, vpls, overlap, falloff), target))


@wide_jit
def _sums(
    receivers: Receivers,
    vpls: VirtualPointLights,
    overlap: Float[Array, "receivers vpls"],
    falloff: FalloffParameters,
) -> Float[Array, "receivers 3 columns"]:
    """Irradiance [W/m²] by overlap: column 0 is always visible, the others belong to the nodes.

    A pair between two nodes is divided between them linearly in the logarithm of the overlap. One matrix
    product per receiver is faster than a pass over all pairs per node.
    """
    axes = vpl_axes(vpls)
    step = np.log(_MOST / _LEAST) / (NODES - 1)
    columns = jnp.arange(-1.0, NODES)

    def of_chunk(position: Array, normal: Array, overlap: Array) -> Float[Array, "chunk 3 columns"]:
        squared, form_at = pair_forms(Receivers(position, normal), vpls, axes)
        transmittance = jnp.exp(-falloff.extinction_coefficient * jnp.sqrt(squared))
        form = falloff.intensity / jnp.pi * form_at(falloff.falloff_footprint) * transmittance
        # Position along the nodes, from 0; what is always visible is at -1, the first column.
        place = jnp.where(overlap > _LEAST, jnp.log(jnp.maximum(overlap, _LEAST) / _LEAST) / step, -1.0)
        share = jnp.maximum(1.0 - jnp.abs(place[:, :, None] - columns), 0.0)
        return jnp.matmul(form[:, None, :] * vpls.flux.T, share, precision="highest")

    arrays = (receivers.position, receivers.normal, overlap)
    return map_receivers(of_chunk, arrays, vpls.position.shape[0], PAIRS_AT_ONCE)
