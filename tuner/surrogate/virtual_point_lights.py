"""The receivers and VPLs of one view as JAX arrays, in units of the scene length L."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.frame.capture import CapturedFrame


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Receivers:
    """Surface points that receive light. Positions are in units of L, relative to the centre of the VPLs."""

    position: Float[Array, "receivers 3"]
    normal: Float[Array, "receivers 3"]
    """Unit length."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class VirtualPointLights:
    """Many VPLs or a single one, in the coordinates of `Receivers`."""

    position: Float[Array, "*vpls 3"]
    normal: Float[Array, "*vpls 3"]
    """Unit length."""
    footprint: Float[Array, "*vpls"]
    """Radius in units of L."""
    flux: Float[Array, "*vpls 3"]
    """Flux ÷ L², so that irradiance is in W/m² although lengths are in L."""
    cells: bool = field(default=False, metadata={"static": True})
    """Whether they are clustered disc lights instead of points."""


def gather_inputs(
    captured: CapturedFrame, pixels: np.ndarray | None = None
) -> tuple[Receivers, VirtualPointLights]:
    """The receivers and VPLs of a captured frame, centred on the lit VPLs and scaled by 1/L.

    These coordinates have no unit. Centring keeps the precision of float32 for distances within the lit part
    of the scene instead of the distance to the world's origin.

    Args:
        captured: The frame. Its receivers are the valid pixels in row order.
        pixels: Indices into those valid pixels; None for all.
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
            # An empty RSM leaves VPLs without flux at the world's origin. Move them to the centre, where they
            # are harmless.
            jnp.asarray(np.where(lit[:, None], (vpl_position - center) / length, 0.0), jnp.float32),
            jnp.asarray(captured.vpl_normal_world, jnp.float32),
            jnp.asarray(captured.vpl_footprint / length, jnp.float32),
            jnp.asarray(captured.vpl_flux.astype(np.float64) / length**2, jnp.float32),
            captured.vpls_are_discs,
        ),
    )
