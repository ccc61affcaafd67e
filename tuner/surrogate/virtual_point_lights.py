"""Receivers and VPLs of one view as JAX arrays without world units."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.frame.capture import CapturedFrame


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Receivers:
    """Surface points that light falls on: positions in units of L, about the VPLs' centre."""

    position: Float[Array, "receivers 3"]
    normal: Float[Array, "receivers 3"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class VirtualPointLights:
    """VPLs, or one of them, in the same coordinates. `flux` is in W/L²: irradiance keeps its unit, W/m²."""

    position: Float[Array, "*vpls 3"]
    normal: Float[Array, "*vpls 3"]
    footprint: Float[Array, "*vpls"]
    """Radius in units of L."""
    flux: Float[Array, "*vpls 3"]
    cells: bool = field(default=False, metadata={"static": True})
    """Whether they shine as discs, and not as points."""


def gather_inputs(
    captured: CapturedFrame, pixels: np.ndarray | None = None
) -> tuple[Receivers, VirtualPointLights]:
    """The receivers and VPLs of a captured frame, centred on the VPLs and scaled by L.

    In these coordinates no length has a unit, and float32's digits are spent on the distance to the lit
    part of the scene, not to the world's origin.

    Args:
        captured: the frame; its receivers are the valid pixels in row order.
        pixels: indices into those valid pixels; None takes all.
    """
    selected = np.flatnonzero(captured.valid.ravel())
    if pixels is not None:
        selected = selected[pixels]
    position = captured.position_world.reshape(-1, 3)[selected].astype(np.float64)
    vpl_position = captured.vpl_position_world.astype(np.float64)
    lit = captured.vpl_flux.sum(axis=1) > 0.0
    center = vpl_position[lit].mean(axis=0) if lit.any() else np.zeros(3)
    length = captured.scene_length
    return (
        Receivers(
            jnp.asarray((position - center) / length, jnp.float32),
            jnp.asarray(captured.normal_world.reshape(-1, 3)[selected], jnp.float32),
        ),
        VirtualPointLights(
            # An empty RSM leaves VPLs without flux at the world's origin: at the centre they harm nothing.
            jnp.asarray(np.where(lit[:, None], (vpl_position - center) / length, 0.0), jnp.float32),
            jnp.asarray(captured.vpl_normal_world, jnp.float32),
            jnp.asarray(captured.vpl_footprint / length, jnp.float32),
            jnp.asarray(captured.vpl_flux.astype(np.float64) / length**2, jnp.float32),
            captured.vpls_are_discs,
        ),
    )
