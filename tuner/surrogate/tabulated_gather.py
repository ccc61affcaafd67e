"""The gather tabulated over α and κ: a fit step that does not depend on the number of VPLs.

For VPLs and receivers that stand still, irradiance is a smooth function of the falloff parameters, whatever
form a VPL has. So it is gathered once at the nodes of a grid over their ranges, and is the cubic spline
through them after that: a gradient step is a matrix product of the images at the nodes with the nodes'
weights. Nodes stand closest where fits end, α about 1 and κ about 0. k is a factor. Twin in value:
`tuner.surrogate.vpl_gather.gather`.

A polynomial through Chebyshev points serves softened points as well, but not discs: where the edge of one
passes over receivers it swings, and the image of a room erred by a tenth.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.interpolate import CubicSpline

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.tuner.surrogate.receiver_chunks import map_receivers
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, pair_forms, vpl_axes
from vpltune.tuner.surrogate.wide_vectors import wide_jit

Visibility = Bool[np.ndarray, "receivers vpls"] | Float[Array, "receivers vpls"]
"""Share of each VPL's light that reaches each receiver, in [0, 1]."""

FOOTPRINT_NODES = 13
TRANSMITTANCE_NODES = 8
"""Of α, an odd number, so that 1 is one of them, and κ."""
PAIRS_AT_ONCE = 2**15
"""Receivers times VPLs that are gathered in one go: all nodes of these, 4 MiB, stay in a core's cache."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TabulatedGather:
    """Irradiance of many receivers at the nodes, for k = 1."""

    irradiance: Float[Array, "receivers 3 nodes"]
    """[W/m²]. Nodes are ordered by α, then κ."""


def tabulate_gather(
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None = None,
) -> TabulatedGather:
    """Gather at all nodes; done once for each placement of the VPLs.

    Args:
        receivers, vpls: in units of L.
        visibility: share of each VPL's light that reaches each receiver; None for all of it.
    """
    arrays = (receivers.position, receivers.normal, visibility)
    return TabulatedGather(_images(*(None if each is None else jnp.asarray(each) for each in arrays), vpls))


def gather_tabulated(table: TabulatedGather, parameters: FalloffParameters) -> Float[Array, "receivers 3"]:
    """Indirect irradiance [W/m²] at every receiver, as `tuner.surrogate.vpl_gather.gather` gives it."""
    weights = node_weights(parameters)
    return parameters.intensity * jnp.matmul(table.irradiance, weights, precision=jax.lax.Precision.HIGHEST)


def node_weights(parameters: FalloffParameters) -> Float[Array, " nodes"]:
    """What each node counts for the spline's value at α and κ, in the order of `TabulatedGather`."""
    of_alpha = _spline_weights(_footprint_place(parameters.falloff_footprint), FOOTPRINT_NODES)
    of_kappa = _spline_weights(_transmittance_place(parameters.extinction_coefficient), TRANSMITTANCE_NODES)
    return (of_alpha[:, None] * of_kappa).ravel()


_ALPHA, _KAPPA = parameter_spec("falloff_footprint"), parameter_spec("extinction_coefficient")


def _footprint_place(footprint: Array | float) -> Array:
    """Of α along its nodes, in [0, 1]."""
    first, last, here = (jnp.arcsinh(2.0 * jnp.log(value)) for value in (_ALPHA.low, _ALPHA.high, footprint))
    return (here - first) / (last - first)


def _transmittance_place(transmittance: Array | float) -> Array:
    """Of κ along its nodes, in [0, 1]."""
    return jnp.log1p(4.0 * transmittance) / np.log1p(4.0 * _KAPPA.high)


def _footprint_nodes() -> Float[np.ndarray, " nodes"]:
    ends = np.arcsinh(2.0 * np.log([_ALPHA.low, _ALPHA.high]))
    return np.exp(np.sinh(np.linspace(*ends, FOOTPRINT_NODES)) / 2.0).astype(np.float32)


def _transmittance_nodes() -> Float[np.ndarray, " nodes"]:
    places = np.linspace(0.0, np.log1p(4.0 * _KAPPA.high), TRANSMITTANCE_NODES)
    return (np.expm1(places) / 4.0).astype(np.float32)


def _spline_weights(place: Array, count: int) -> Float[Array, " nodes"]:
    """What each of `count` even nodes over [0, 1] counts for the cubic spline's value at `place`."""
    coefficients = jnp.asarray(CubicSpline(np.arange(count), np.eye(count)).c, jnp.float32)
    interval = jnp.clip((place * (count - 1)).astype(jnp.int32), 0, count - 2)
    x = place * (count - 1) - interval
    cubic, square, linear, constant = coefficients[:, interval]
    return ((cubic * x + square) * x + linear) * x + constant


@wide_jit
def _images(
    position: Array, normal: Array, visibility: Array | None, vpls: VirtualPointLights
) -> Float[Array, "receivers 3 nodes"]:
    axes = vpl_axes(vpls)

    def of_chunk(position: Array, normal: Array, visible: Array | None) -> Array:
        squared, form_at = pair_forms(Receivers(position, normal), vpls, axes)
        distance = jnp.sqrt(squared)
        forms = jnp.stack([form_at(jnp.asarray(alpha)) for alpha in _footprint_nodes()], axis=1)
        arriving = jnp.stack([jnp.exp(-kappa * distance) for kappa in _transmittance_nodes()], axis=2)
        if visible is not None:
            arriving = arriving * visible[:, :, None]
        arriving = arriving[:, :, None, :] * (vpls.flux / jnp.pi)[None, :, :, None]
        arriving = arriving.reshape(*arriving.shape[:2], -1)
        images = jnp.matmul(forms, arriving, precision=jax.lax.Precision.HIGHEST)
        images = images.reshape(-1, FOOTPRINT_NODES, 3, TRANSMITTANCE_NODES)
        return images.transpose(0, 2, 1, 3).reshape(-1, 3, FOOTPRINT_NODES * TRANSMITTANCE_NODES)

    return map_receivers(of_chunk, (position, normal, visibility), vpls.position.shape[0], PAIRS_AT_ONCE)
