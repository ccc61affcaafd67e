"""The loss of a captured view, tabulated over the parameters that a prior sets: a training step is a lookup.

Let y be the image at intensity 1. Then the loss Σ w (ky − a)(ky − b) is A k² − B k + C, where A = Σ w y²,
B = Σ w y (a + b) and C = Σ w a b. Only A and B depend on the other parameters, and they do so smoothly. They
are tabulated over α, β and σ with the surrogate (`tuner.surrogate.vpl_gather`,
`tuner.surrogate.vpl_visibility`) and interpolated: cubic in α, linear in β and σ.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.tuner.metrics.relative_squared_error import Target, target_of
from vpltune.tuner.metrics.robust_error import robust_error
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights, gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.vpl_visibility import (
    VisibilityParameters,
    map_texels,
    seen_share,
    surface_overlap,
)
from vpltune.tuner.surrogate.wide_vectors import wide_jit

RECEIVERS = 2048
"""Largest number of pixels of a view that enter its table. A choice."""

FOOTPRINT_PLACES = tuple(np.linspace(0.3, 0.7, 9).tolist())
"""Nodes along the axis of α in the unit cube, from α = 0.3 to 3.3. A choice: 1, where a clustered disc has
its own radius, is the middle one."""
BIAS_PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Nodes along the axis of β, over its whole range. A choice."""
SOFTNESS_PLACES = tuple(np.linspace(0.0, 1.0, 7).tolist())
"""Nodes along the axis of σ, over its whole range. A choice."""

_PLACES = (FOOTPRINT_PLACES, BIAS_PLACES, SOFTNESS_PLACES)  # in the order of AUTO_PARAMETERS[1:]
_INTENSITY_SPEC = parameter_spec("intensity")  # row of k in the parameter table
LOWEST_POINT, HIGHEST_POINT = (
    np.array([_INTENSITY_SPEC.place_of(intensity), *(places[end] for places in _PLACES)], np.float32)
    for intensity, end in ((0.5, 0), (2.0, -1))
)
"""Opposite corners of the part of the unit cube that the tables cover, with k from 1/2 to 2. A choice."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LossTable:
    """The table of one view, or the stacked tables of many."""

    square: Float[Array | np.ndarray, "*views footprints biases softnesses"]
    """A = Σ w y²."""
    product: Float[Array | np.ndarray, "*views footprints biases softnesses"]
    """B = Σ w y (a + b)."""
    constant: Float[Array | np.ndarray, "*views"]
    """C = Σ w a b."""


def loss_table(
    view: CapturedView, parameters: ArtistParameters, seed: int, *, robust: bool = True
) -> LossTable:
    """The table of one view, from its captured buffers and visibility maps. For a black view it is all zeros.

    Args:
        view: The captured view.
        parameters: Parameters of the capture; κ is kept at its value.
        seed: Seed of the choice of pixels.
        robust: Whether pixels are weighted as in the first step of a robust fit that starts from the captured
            image; otherwise the loss is relMSE.
    """
    values = view.pixel_values(RECEIVERS, seed)
    receivers, vpls = gather_inputs(view.captured, values.chosen)
    weight = None
    if robust:
        mean = (values.half_a + values.half_b) / 2.0
        weight = robust_error(mean, values.direct, values.drawn).weights(values.drawn)
    target = target_of(values.half_a, values.half_b, weight)
    maps = view.captured.visibility_maps
    overlap = None if maps is None else surface_overlap(receivers, vpls, map_texels(maps))
    square, product = _sums(receivers, vpls, overlap, jnp.float32(parameters.extinction_coefficient), target)
    constant = np.sum(np.asarray(target.weight * target.half_a * target.half_b, np.float64))
    return LossTable(np.asarray(square), np.asarray(product), np.array(constant, np.float32))


@wide_jit
def _sums(
    receivers: Receivers,
    vpls: VirtualPointLights,
    overlap: Array | None,
    transmittance: Array,
    target: Target,
) -> tuple[Array, Array]:
    """A and B at all nodes."""
    footprints, biases, softnesses = (
        jnp.array([parameter_spec(name).value_at(place) for place in places], jnp.float32)
        for name, places in zip(AUTO_PARAMETERS[1:], _PLACES, strict=True)
    )

    def at(footprint: Array, seen: Array | None) -> tuple[Array, Array]:
        image = gather(receivers, vpls, FalloffParameters(jnp.ones(()), footprint, transmittance), seen)
        weighed = target.weight * image
        return jnp.sum(weighed * image), jnp.sum(weighed * (target.half_a + target.half_b))

    def at_all_footprints(node: tuple[Array, Array]) -> tuple[Array, Array]:
        seen = None if overlap is None else seen_share(overlap, VisibilityParameters(*node))
        return jax.vmap(at, in_axes=(0, None))(footprints, seen)

    grid = jnp.meshgrid(biases, softnesses, indexing="ij")
    sums = jax.lax.map(at_all_footprints, tuple(values.ravel() for values in grid))
    return tuple(values.T.reshape(*map(len, _PLACES)) for values in sums)


def table_loss(table: LossTable, point: Float[Array | np.ndarray, " parameters"]) -> Float[Array, ""]:
    """The loss of one view at a point between `LOWEST_POINT` and `HIGHEST_POINT`; differentiable."""
    square, product = _interpolated(table, jnp.asarray(point))
    intensity = _INTENSITY_SPEC.value_at(jnp.asarray(point)[0])
    return intensity**2 * square - intensity * product + table.constant


def table_residuals(
    table: LossTable, point: Float[Array | np.ndarray, " parameters"]
) -> Float[Array, " residuals"]:
    """Two numbers whose squares sum to `table_loss`, or to 0 where that is negative; differentiable.

    A k² − B k + C = (√A k − B/(2√A))² + (C − B²/(4A)). The second term is the loss at the best intensity. It
    falls below zero only by the noise of the reference's halves.
    """
    square, product = _interpolated(table, jnp.asarray(point))
    intensity = _INTENSITY_SPEC.value_at(jnp.asarray(point)[0])
    # 1e-30: where no light arrives the table is zero, and so are both residuals.
    root = jnp.sqrt(jnp.maximum(square, 1e-30))
    least = table.constant - (product / (2.0 * root)) ** 2
    # Below the noise the root has no slope, which keeps its gradient finite.
    seen = least > 0.0
    return jnp.stack(
        [
            root * intensity - product / (2.0 * root),
            jnp.where(seen, jnp.sqrt(jnp.where(seen, least, 1.0)), 0.0),
        ]
    )


def _interpolated(table: LossTable, point: Array) -> tuple[Array, Array]:
    """A and B at a point."""
    starts, weights = zip(
        _cubic(point[1], FOOTPRINT_PLACES),
        _linear(point[2], BIAS_PLACES),
        _linear(point[3], SOFTNESS_PLACES),
        strict=True,
    )

    def at(values: Array | np.ndarray) -> Array:
        near = jax.lax.dynamic_slice(values, starts, (4, 2, 2))
        return jnp.einsum("abc,a,b,c->", near, *weights, precision=jax.lax.Precision.HIGHEST)

    return at(table.square), at(table.product)


def default_point(parameters: ArtistParameters) -> Float32[np.ndarray, " parameters"]:
    """The point of `parameters` in the unit cube with the axes `AUTO_PARAMETERS`."""
    given = parameters.as_dict()
    return np.array([parameter_spec(name).place_of(given[name]) for name in AUTO_PARAMETERS], np.float32)


def _cubic(place: Array, nodes: tuple[float, ...]) -> tuple[Array, Float[Array, "4"]]:
    """First node and weights of cubic Lagrange interpolation on equidistant nodes; one-sided at both ends."""
    scaled = (place - nodes[0]) / (nodes[1] - nodes[0])
    first = jnp.clip(jnp.floor(scaled) - 1.0, 0.0, len(nodes) - 4.0).astype(jnp.int32)
    x = scaled - first
    weights = [
        -(x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0,
        x * (x - 2.0) * (x - 3.0) / 2.0,
        -x * (x - 1.0) * (x - 3.0) / 2.0,
        x * (x - 1.0) * (x - 2.0) / 6.0,
    ]
    return first, jnp.stack(weights)


def _linear(place: Array, nodes: tuple[float, ...]) -> tuple[Array, Float[Array, "2"]]:
    """First node and weights of linear interpolation between arbitrary nodes; constant outside them."""
    at = jnp.array(nodes, jnp.float32)
    first = jnp.clip(jnp.searchsorted(at, place, side="right") - 1, 0, len(nodes) - 2).astype(jnp.int32)
    share = jnp.clip((place - at[first]) / (at[first + 1] - at[first]), 0.0, 1.0)
    return first, jnp.stack([1.0 - share, share])
