"""The VPL gather in JAX: the twin of shaders/vpl_gather.comp and shaders/common/vpl_irradiance.glsl.

Points: Keller 1997 (instant radiosity), with the point spread over its footprint: 1/d² becomes
1/(d² + (αl)²), which for α = 1 is the exact form factor of a coaxial disc. Cells: `tuner.vpl_disc`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from renderer.artist_parameters import ArtistParameters
from renderer.vpl_disc_bounds import LEAST_RADIUS
from tuner.virtual_point_lights import Receivers, VirtualPointLights
from tuner.vpl_disc import disc_form

PAIRS_AT_ONCE = 2**19
"""Receivers times VPLs in one go: 2 MiB an array, which stays in a core's cache, for any number of VPLs."""

Pairs = Float[Array, "receivers vpls"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FalloffParameters:
    """The continuous parameters of the gather; see `renderer.artist_parameters` for ranges and units."""

    intensity: Float[Array, ""]
    falloff_footprint: Float[Array, ""]
    falloff_transmittance: Float[Array, ""]

    @classmethod
    def of(cls, parameters: ArtistParameters) -> "FalloffParameters":
        """Those of a config."""
        return cls(
            jnp.float32(parameters.intensity),
            jnp.float32(parameters.falloff_footprint),
            jnp.float32(parameters.falloff_transmittance),
        )


def vpl_irradiance(
    position: Float[Array, "3"],
    normal: Float[Array, "3"],
    vpl: VirtualPointLights,
    parameters: FalloffParameters,
) -> Float[Array, "3"]:
    """Irradiance of one VPL at one receiver, lengths in units of L. Twin: `vpl_irradiance` in GLSL."""
    to_vpl = vpl.position - position
    # As in `pair_forms`.
    squared = jnp.maximum(jnp.dot(to_vpl, to_vpl), 1e-18)
    facing, height = jnp.dot(normal, to_vpl), -jnp.dot(vpl.normal, to_vpl)
    footprint = parameters.falloff_footprint * vpl.footprint
    if vpl.cells:
        between = jnp.dot(normal, vpl.normal)
        form = disc_form(squared, facing, height, between, jnp.maximum(footprint, LEAST_RADIUS))
    else:
        form = jnp.maximum(facing, 0.0) * jnp.maximum(height, 0.0) / squared / (squared + footprint**2)
    transmittance = jnp.exp(-parameters.falloff_transmittance * jnp.sqrt(squared))
    return vpl.flux * (parameters.intensity / jnp.pi * form * transmittance)


def gather_pairwise(
    receivers: Receivers, vpls: VirtualPointLights, parameters: FalloffParameters
) -> Float[Array, "receivers 3"]:
    """The gather as its definition reads, pair by pair: what `gather` is tested and timed against."""

    def at(position: Float[Array, "3"], normal: Float[Array, "3"]) -> Float[Array, "3"]:
        each = jax.vmap(vpl_irradiance, in_axes=(None, None, 0, None))
        return each(position, normal, vpls, parameters).sum(axis=0)

    return jax.vmap(at)(receivers.position, receivers.normal)


def pair_forms(receivers: Receivers, vpls: VirtualPointLights) -> tuple[Pairs, Callable[[Array], Pairs]]:
    """Squared distances, and what gives each pair's irradiance, in units of Φ/π, for an α.

    Written axis by axis, so that XLA fuses it all into one loop and no array of [receivers, vpls, 3] is made.
    That is as fast as |x|² + |v|² − 2 x·v from a matrix product, whose three axes are too few to gain by, and
    does not cancel: near contacts the matrix form lost three digits (1e-6 became 2e-3 relative RMSE).
    """
    squared = facing = height = between = jnp.zeros(())
    for axis in range(3):
        to_vpl = vpls.position[None, :, axis] - receivers.position[:, None, axis]
        normal, vpl_normal = receivers.normal[:, None, axis], vpls.normal[None, :, axis]
        squared = squared + to_vpl**2
        facing = facing + normal * to_vpl
        height = height - vpl_normal * to_vpl
        between = between + normal * vpl_normal
    # Keeps quotients finite where receiver and VPL coincide; both cosines are 0 there. 1e-18 and not less:
    # XLA may turn x/y/y into x/(y·y), and that square must still be a float32.
    squared = jnp.maximum(squared, 1e-18)
    if vpls.cells:

        def disc(falloff_footprint: Array) -> Pairs:
            radius = jnp.maximum(falloff_footprint * vpls.footprint, LEAST_RADIUS)
            return disc_form(squared, facing, height, between, radius)

        return squared, disc
    cosines = jnp.maximum(facing, 0.0) * jnp.maximum(height, 0.0) / squared
    return squared, lambda falloff_footprint: cosines / (squared + (falloff_footprint * vpls.footprint) ** 2)


def receivers_at_once(vpls: int, pairs: int) -> int:
    """How many receivers' pairs with all VPLs are about `pairs`: a power of two, at least 1."""
    return 2 ** max((pairs // max(vpls, 1)).bit_length() - 1, 0)


def gather(
    receivers: Receivers,
    vpls: VirtualPointLights,
    parameters: FalloffParameters,
    visibility: Bool[Array, "receivers vpls"] | Float[Array, "receivers vpls"] | None = None,
) -> Float[Array, "receivers 3"]:
    """Indirect irradiance [W/m²] at every receiver from all VPLs.

    Args:
        receivers, vpls: in units of L (see `tuner.virtual_point_lights.gather_inputs`).
        parameters: k, α, κ.
        visibility: share of each VPL's light that reaches each receiver; None takes all of it, as the
            runtime does without visibility maps.
    """
    count = receivers.position.shape[0]
    chunk_size = min(receivers_at_once(vpls.position.shape[0], PAIRS_AT_ONCE), max(count, 1))
    padding = ((0, -count % chunk_size), (0, 0))

    def chunked(values: Array) -> Array:
        return jnp.pad(values, padding).reshape(-1, chunk_size, values.shape[1])

    # Made anew for its gradient: kept, all pairs of all chunks would be written out and read back, which took
    # forty times as long and memory that grows with their number.
    @partial(jax.checkpoint, prevent_cse=False)
    def gather_chunk(chunk: tuple[Array, Array, Array | None]) -> Array:
        position, normal, visible = chunk
        squared, form = pair_forms(Receivers(position, normal), vpls)
        transmittance = jnp.exp(-parameters.falloff_transmittance * jnp.sqrt(squared))
        weight = form(parameters.falloff_footprint) * transmittance
        if visible is not None:
            weight = weight * visible
        return jnp.matmul(weight, vpls.flux, precision=jax.lax.Precision.HIGHEST)

    inputs = (
        chunked(receivers.position),
        chunked(receivers.normal),
        None if visibility is None else chunked(visibility),
    )
    irradiance = jax.lax.map(gather_chunk, inputs).reshape(-1, 3)[:count]
    return irradiance * (parameters.intensity / jnp.pi)
