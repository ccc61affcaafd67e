"""The VPL gather in JAX. Twins: shaders/vpl_gather/vpl_gather.comp and shaders/common/vpl_irradiance.glsl.

Points follow Keller 1997 (instant radiosity), with each point spread over its footprint l: 1/d² becomes
1/(d² + (αl)²), which for α = 1 is the exact form factor of a coaxial disc. Clustered disc lights are in
`tuner.surrogate.vpl_disc`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Bool, Float

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.vpl_disc_bounds import LEAST_RADIUS
from vpltune.tuner.surrogate.receiver_chunks import map_receivers
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_disc import disc_form

PAIRS_AT_ONCE = 2**19
"""Receivers times VPLs in one chunk. A choice: an array then takes 2 MiB and stays in a core's cache, for any
number of VPLs."""

Pairs = Float[Array, "receivers vpls"]
"""One value for each pair of receiver and VPL."""
Visibility = Bool[Array, "receivers vpls"] | Float[Array, "receivers vpls"]
"""Share of each VPL's light that reaches each receiver, in [0, 1]."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FalloffParameters:
    """The continuous parameters of the gather. Ranges and units: `renderer.config.artist_parameters`."""

    intensity: Float[Array, ""]
    """k."""
    falloff_footprint: Float[Array, ""]
    """α."""
    extinction_coefficient: Float[Array, ""]
    """κ."""

    @classmethod
    def of(cls, parameters: ArtistParameters) -> "FalloffParameters":
        """The falloff parameters of a config."""
        return cls(
            jnp.float32(parameters.intensity),
            jnp.float32(parameters.falloff_footprint),
            jnp.float32(parameters.extinction_coefficient),
        )


def vpl_irradiance(
    position: Float[Array, "3"],
    normal: Float[Array, "3"],
    vpl: VirtualPointLights,
    parameters: FalloffParameters,
) -> Float[Array, "3"]:
    """Irradiance [W/m²] of one VPL at one receiver, lengths in units of L. Twin: `vpl_irradiance` in GLSL."""
    to_vpl = vpl.position - position
    # The clamp is that of `pair_forms`.
    squared = jnp.maximum(jnp.dot(to_vpl, to_vpl), 1e-18)
    facing, height = jnp.dot(normal, to_vpl), -jnp.dot(vpl.normal, to_vpl)
    footprint = parameters.falloff_footprint * vpl.footprint
    if vpl.cells:
        between = jnp.dot(normal, vpl.normal)
        form = disc_form(squared, facing, height, between, jnp.maximum(footprint, LEAST_RADIUS))
    else:
        form = jnp.maximum(facing, 0.0) * jnp.maximum(height, 0.0) / squared / (squared + footprint**2)
    transmittance = jnp.exp(-parameters.extinction_coefficient * jnp.sqrt(squared))
    return vpl.flux * (parameters.intensity / jnp.pi * form * transmittance)


def gather_pairwise(
    receivers: Receivers, vpls: VirtualPointLights, parameters: FalloffParameters
) -> Float[Array, "receivers 3"]:
    """The gather [W/m²], pair by pair, as it is defined. Tests and benchmarks compare `gather` with it."""

    def at(position: Float[Array, "3"], normal: Float[Array, "3"]) -> Float[Array, "3"]:
        each = jax.vmap(vpl_irradiance, in_axes=(None, None, 0, None))
        return each(position, normal, vpls, parameters).sum(axis=0)

    return jax.vmap(at)(receivers.position, receivers.normal)


def vpl_axes(vpls: VirtualPointLights) -> Float[Array, "6 vpls"]:
    """x, y and z of the positions, then of the normals, one row each."""
    return jnp.concatenate([vpls.position.T, vpls.normal.T])


def pair_forms(
    receivers: Receivers, vpls: VirtualPointLights, axes: Float[Array, "6 vpls"]
) -> tuple[Pairs, Callable[[Array], Pairs]]:
    """Squared distance of each pair, and a function from α to each pair's irradiance in units of Φ/π.

    It is written axis by axis, so that XLA fuses it into one loop without an array [receivers, vpls, 3]. This
    is as fast as |x|² + |v|² − 2 x·v with a matrix product, because three axes are too few for that to pay
    off. And it has no cancellation: near contacts, the matrix form lost three digits (relative RMSE 2e-3
    instead of 1e-6).

    Args:
        receivers: Receivers, in units of L.
        vpls: VPLs, in units of L.
        axes: `vpl_axes(vpls)`. Compute it outside any loop over receivers, which would otherwise extract the
            axes from [vpls, 3] again for every few pairs.
    """
    squared = facing = height = between = jnp.zeros(())
    for axis in range(3):
        to_vpl = axes[axis] - receivers.position[:, None, axis]
        normal, vpl_normal = receivers.normal[:, None, axis], axes[3 + axis]
        squared = squared + to_vpl**2
        facing = facing + normal * to_vpl
        height = height - vpl_normal * to_vpl
        between = between + normal * vpl_normal
    # The clamp keeps quotients finite where receiver and VPL coincide; both cosines are 0 there. It cannot be
    # smaller than 1e-18: XLA may turn x/y/y into x/(y·y), and y·y must still be a normal float32.
    squared = jnp.maximum(squared, 1e-18)
    if vpls.cells:

        def disc(falloff_footprint: Array) -> Pairs:
            radius = jnp.maximum(falloff_footprint * vpls.footprint, LEAST_RADIUS)
            return disc_form(squared, facing, height, between, radius)

        return squared, disc
    cosines = jnp.maximum(facing, 0.0) * jnp.maximum(height, 0.0) / squared
    return squared, lambda falloff_footprint: cosines / (squared + (falloff_footprint * vpls.footprint) ** 2)


def gather(
    receivers: Receivers,
    vpls: VirtualPointLights,
    parameters: FalloffParameters,
    visibility: Visibility | None = None,
) -> Float[Array, "receivers 3"]:
    """Indirect irradiance [W/m²] at each receiver from all VPLs.

    Args:
        receivers: Receivers, in units of L (see `tuner.surrogate.virtual_point_lights.gather_inputs`).
        vpls: VPLs, in units of L.
        parameters: k, α and κ.
        visibility: Share of each VPL's light that reaches each receiver, in [0, 1]; None for all of it, as in
            the runtime without visibility maps.
    """
    scene, structure = jax.tree.flatten((receivers, vpls, visibility))
    image = _image(structure, parameters.falloff_footprint, parameters.extinction_coefficient, *scene)
    return image * (parameters.intensity / jnp.pi)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _image(structure: Any, footprint: Array, transmittance: Array, *scene: Array) -> Array:
    """The gather for k = π. `structure` is the tree of receivers, VPLs and visibility, `scene` its leaves."""
    return _weighted_flux(partial(_weight, footprint, transmittance), *structure.unflatten(scene))


@partial(_image.defjvp, symbolic_zeros=True)
def _image_jvp(structure: Any, primals: tuple[Array, ...], tangents: tuple[Any, ...]) -> tuple[Array, Array]:
    """The derivatives by α and κ, one more gather each. Reverse mode through all pairs takes longer than
    these three gathers, most of all for discs. A tangent is an array or a `SymbolicZero`."""
    moving = [index for index, tangent in enumerate(tangents) if not isinstance(tangent, SymbolicZero)]
    if any(index > 1 for index in moving):
        # The scene is differentiated as well, so use JAX's own rule.
        def moved_image(*moved: Array) -> Array:
            values = dict(enumerate(primals)) | dict(zip(moving, moved, strict=True))
            return _image.fun(structure, *values.values())

        return jax.jvp(
            moved_image, [primals[index] for index in moving], [tangents[index] for index in moving]
        )
    footprint, transmittance, *scene = primals

    def by_footprint(*pair: Any) -> Pairs:
        return _derivative(lambda value: _weight(value, transmittance, *pair), footprint)

    def by_transmittance(*pair: Any) -> Pairs:
        return _derivative(lambda value: _weight(footprint, value, *pair), transmittance)

    image = _image(structure, *primals)
    tangent = jnp.zeros_like(image)
    for index in moving:
        derivative = _weighted_flux((by_footprint, by_transmittance)[index], *structure.unflatten(scene))
        tangent = tangent + derivative * tangents[index]
    return image, tangent


def _derivative(function: Callable[[Array], Pairs], value: Array) -> Pairs:
    return jax.jvp(function, (value,), (jnp.ones_like(value),))[1]


def _weight(footprint: Array, transmittance: Array, squared: Pairs, form: Callable[[Array], Pairs]) -> Pairs:
    """The factor on the VPL's flux for each pair, for k = π."""
    return form(footprint) * jnp.exp(-transmittance * jnp.sqrt(squared))


def _weighted_flux(
    weight_of: Callable[[Pairs, Callable[[Array], Pairs]], Pairs],
    receivers: Receivers,
    vpls: VirtualPointLights,
    visibility: Visibility | None,
) -> Float[Array, "receivers 3"]:
    """Σ weight · flux over the VPLs at each receiver; `weight_of` takes the results of `pair_forms`."""
    axes = vpl_axes(vpls)

    # Recompute the chunk for its gradient. Storing all pairs of all chunks would take memory in proportion to
    # their number, and took forty times as long.
    @partial(jax.checkpoint, prevent_cse=False)
    def of_chunk(position: Array, normal: Array, visible: Array | None) -> Array:
        weight = weight_of(*pair_forms(Receivers(position, normal), vpls, axes))
        if visible is not None:
            weight = weight * visible
        return jnp.matmul(weight, vpls.flux, precision=jax.lax.Precision.HIGHEST)

    arrays = (receivers.position, receivers.normal, visibility)
    return map_receivers(of_chunk, arrays, vpls.position.shape[0], PAIRS_AT_ONCE)
