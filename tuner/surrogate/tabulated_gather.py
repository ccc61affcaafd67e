"""The gather tabulated over α and κ, so that the cost of a fit step does not depend on the number of VPLs.

For fixed VPLs and receivers, irradiance is a smooth function of the falloff parameters, for points and for
discs. So it is gathered once at the nodes of a grid over their ranges, and interpolated by a cubic spline
from then on. A gradient step is then a matrix product of the images at the nodes with the weights of the
nodes. The nodes are densest where fits end, near α = 1 and κ = 0. k is a factor.
`tuner.surrogate.vpl_gather.gather` gives the same values.

A polynomial through Chebyshev nodes is as good for points but not for discs: it oscillates where the edge of
a disc passes over receivers, and the image of a room was off by a tenth.
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
"""Nodes of α. A choice; odd, so that α = 1 is a node."""
TRANSMITTANCE_NODES = 8
"""Nodes of κ. A choice."""
PAIRS_AT_ONCE = 2**15
"""Receivers times VPLs in one chunk. A choice: with all nodes it takes 4 MiB and stays in a core's cache."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TabulatedGather:
    """Irradiance of many receivers at all nodes, for k = 1."""

    irradiance: Float[Array, "receivers 3 nodes"]
    """[W/m²]. The nodes are ordered by α, then by κ."""


def tabulate_gather(
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None = None,
) -> TabulatedGather:
    """Gather at all nodes. This is done once for each placement of the VPLs.

    Args:
        receivers: Receivers, in units of L.
        vpls: VPLs, in units of L.
        visibility: Share of each VPL's light that reaches each receiver, in [0, 1]; None for all of it.
    """
    position, normal = jnp.asarray(receivers.position), jnp.asarray(receivers.normal)
    seen = None if visibility is None else jnp.asarray(visibility)
    return TabulatedGather(_images(position, normal, seen, vpls))


def gather_tabulated(table: TabulatedGather, parameters: FalloffParameters) -> Float[Array, "receivers 3"]:
    """Indirect irradiance [W/m²] at each receiver, interpolated. Compare `vpl_gather.gather`."""
    weights = node_weights(parameters)
    return parameters.intensity * jnp.matmul(table.irradiance, weights, precision=jax.lax.Precision.HIGHEST)


def node_weights(parameters: FalloffParameters) -> Float[Array, " nodes"]:
    """Weight of each node in the spline's value at α and κ, in the order of `TabulatedGather.irradiance`."""
    of_alpha = _spline_weights(_footprint_place(parameters.falloff_footprint), FOOTPRINT_NODES)
    of_kappa = _spline_weights(_transmittance_place(parameters.extinction_coefficient), TRANSMITTANCE_NODES)
    return (of_alpha[:, None] * of_kappa).ravel()


_ALPHA, _KAPPA = parameter_spec("falloff_footprint"), parameter_spec("extinction_coefficient")


def _footprint_place(footprint: Array | float) -> Array:
    """Position of α along its nodes, in [0, 1]."""
    first, last, here = (jnp.arcsinh(2.0 * jnp.log(value)) for value in (_ALPHA.low, _ALPHA.high, footprint))
    return (here - first) / (last - first)


def _transmittance_place(transmittance: Array | float) -> Array:
    """Position of κ along its nodes, in [0, 1]."""
    return jnp.log1p(4.0 * transmittance) / np.log1p(4.0 * _KAPPA.high)


def _footprint_nodes() -> Float[np.ndarray, " nodes"]:
    first, last = np.arcsinh(2.0 * np.log([_ALPHA.low, _ALPHA.high]))
    return np.exp(np.sinh(np.linspace(first, last, FOOTPRINT_NODES)) / 2.0).astype(np.float32)


def _transmittance_nodes() -> Float[np.ndarray, " nodes"]:
    places = np.linspace(0.0, np.log1p(4.0 * _KAPPA.high), TRANSMITTANCE_NODES)
    return (np.expm1(places) / 4.0).astype(np.float32)


def _spline_weights(place: Array, count: int) -> Float[Array, " nodes"]:
    """Weight of each of `count` equidistant nodes over [0, 1] in the cubic spline's value at `place`."""
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
