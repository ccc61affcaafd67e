"""The gather with its VPLs binned by distance and footprint: a fit step that does not depend on their number.

For VPLs and receivers that stand still, the falloff parameters act on a pair through two lengths alone,
its distance d and the VPL's footprint l:

    f(d, l) = exp(−κ d) / (1 + α² l² / d²)

f is smooth in log d and log l. So each receiver's VPLs are summed once into the nodes of a small grid over
(log d, log l), with the weights that interpolate f between the nodes: cubic in log d (Lagrange), linear in
log l. After that, irradiance is a matrix product of those sums with f at the nodes, and a gradient step
costs the same for any number of VPLs. Twin in value: `tuner.vpl_gather.gather`.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from tuner.virtual_point_lights import Receivers, VirtualPointLights
from tuner.vpl_gather import FalloffParameters, pair_geometry, receivers_at_once

Visibility = Bool[np.ndarray, "receivers vpls"] | Float[Array, "receivers vpls"]
"""Share of each VPL's light that reaches each receiver, in [0, 1]."""

DISTANCE_NODES = 24
FOOTPRINT_NODES = 8
PAIRS_AT_ONCE = 2**18
"""Receivers times VPLs that are binned in one go: 1 MiB an array."""
# Below a tenth of the smallest footprint, 1/(d² + α²l²) has gone flat for any α that is not tiny.
_NEAREST_IN_FOOTPRINTS = 0.1


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class BinnedGather:
    """The sums of many receivers over the grid, and the grid. Lengths in units of L."""

    irradiance: Float[Array, "receivers 3 nodes"]
    """Φ cosθ_x cosθ_j / (π d²) with interpolation weights, summed over VPLs [W/m²].

    Nodes are ordered by distance, then footprint."""
    distance: Float[Array, " distances"]
    footprint: Float[Array, " footprints"]


def bin_vpls(
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None = None,
) -> BinnedGather:
    """Sum every receiver's VPLs onto the grid; done once for each placement of the VPLs.

    Args:
        receivers, vpls: in units of L.
        visibility: share of each VPL's light that reaches each receiver; None for all of it.
    """
    distance, footprint = _grid(receivers, vpls)
    footprint_weight = np.stack(
        [
            np.interp(np.log(np.maximum(vpls.footprint, footprint[0])), np.log(footprint), row)
            for row in np.eye(FOOTPRINT_NODES)
        ],
        axis=1,
    )
    count = receivers.position.shape[0]
    chunk_size = receivers_at_once(vpls.position.shape[0], PAIRS_AT_ONCE)
    padding = ((0, -count % chunk_size), (0, 0))

    def chunked(values: np.ndarray | Array) -> Array:
        return jnp.pad(jnp.asarray(values), padding).reshape(-1, chunk_size, values.shape[1])

    sums = _bin_chunks(
        chunked(receivers.position),
        chunked(receivers.normal),
        None if visibility is None else chunked(visibility),
        vpls,
        jnp.asarray(footprint_weight, jnp.float32),
        jnp.log(jnp.asarray(distance, jnp.float32)),
    )
    return BinnedGather(sums.reshape(-1, *sums.shape[2:])[:count], *map(jnp.asarray, (distance, footprint)))


def gather_binned(binned: BinnedGather, parameters: FalloffParameters) -> Float[Array, "receivers 3"]:
    """Indirect irradiance [W/m²] at every receiver, as `tuner.vpl_gather.gather` gives it."""
    falloff = node_falloff(binned.distance, binned.footprint, parameters)
    return parameters.intensity * jnp.matmul(binned.irradiance, falloff, precision=jax.lax.Precision.HIGHEST)


def node_falloff(
    distance: Float[Array, " distances"],
    footprint: Float[Array, " footprints"],
    parameters: FalloffParameters,
) -> Float[Array, " nodes"]:
    """f(d, l) at the nodes of a grid, in the order of `BinnedGather.irradiance`."""
    softening = parameters.falloff_footprint * footprint[None, :] / distance[:, None]
    transmittance = jnp.exp(-parameters.falloff_transmittance * distance)[:, None]
    return (transmittance / (1.0 + softening**2)).ravel()


def _grid(receivers: Receivers, vpls: VirtualPointLights) -> tuple[np.ndarray, np.ndarray]:
    """Node distances and footprints, geometric, over what occurs."""
    footprints = np.asarray(vpls.footprint)[np.asarray(vpls.flux).sum(axis=1) > 0.0]
    if footprints.size == 0 or receivers.position.shape[0] == 0:
        footprints = np.ones(1)
    low, high = float(footprints.min()), float(footprints.max())
    # A hair wider than the data: one footprint for all VPLs would make a grid of coinciding nodes.
    footprint = np.geomspace(low * 0.999, high * 1.001, FOOTPRINT_NODES)
    span = sum(float(np.abs(np.asarray(side.position)).max(initial=0.0)) for side in (receivers, vpls))
    nearest = _NEAREST_IN_FOOTPRINTS * low
    farthest = max(np.sqrt(3.0) * span, 10.0 * nearest)
    return np.geomspace(nearest, farthest, DISTANCE_NODES).astype(np.float32), footprint.astype(np.float32)


def _cubic_weight(offset: Array) -> Array:
    """Cardinal function of cubic Lagrange interpolation on a unit grid; zero from |offset| = 2 on."""
    a = jnp.abs(offset)
    near = (1.0 - a * a) * (2.0 - a) / 2.0
    far = (1.0 - a) * (2.0 - a) * (3.0 - a) / 6.0
    return jnp.where(a < 1.0, near, jnp.where(a < 2.0, far, 0.0))


@jax.jit
def _bin_chunks(
    position: Array,
    normal: Array,
    visibility: Array | None,
    vpls: VirtualPointLights,
    footprint_weight: Array,
    log_distance: Array,
) -> Float[Array, "chunks chunk 3 nodes"]:
    step = log_distance[1] - log_distance[0]
    flux = vpls.flux[:, :, None] * footprint_weight[:, None, :] / jnp.pi
    flux = flux.reshape(flux.shape[0], -1)

    def bin_chunk(chunk: tuple[Array, Array, Array | None]) -> Array:
        squared, cosines = pair_geometry(Receivers(chunk[0], chunk[1]), vpls)
        form = cosines / squared
        if chunk[2] is not None:
            form = form * chunk[2]
        # Cubic interpolation needs a node on either side of an interval: the outermost two hold no data
        # of their own, and what lies beyond is taken to lie on the last inner node.
        place = jnp.clip((0.5 * jnp.log(squared) - log_distance[0]) / step, 1.0, DISTANCE_NODES - 2.0)

        def node(index: Array) -> Array:
            weight = form * _cubic_weight(place - index)
            return jnp.matmul(weight, flux, precision=jax.lax.Precision.HIGHEST)

        sums = jax.lax.map(node, jnp.arange(DISTANCE_NODES, dtype=jnp.float32))
        sums = sums.reshape(DISTANCE_NODES, -1, 3, FOOTPRINT_NODES)
        return sums.transpose(1, 2, 0, 3).reshape(-1, 3, DISTANCE_NODES * FOOTPRINT_NODES)

    return jax.lax.map(bin_chunk, (position, normal, visibility))
