"""A floor lit by VPLs on two walls, made without a renderer: input that times the surrogate alone."""

import jax
import jax.numpy as jnp
import numpy as np

from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights


def lit_corner(
    random: np.random.Generator, receiver_count: int, vpl_count: int
) -> tuple[Receivers, VirtualPointLights]:
    """Random receivers on a floor of 2 L × 2 L, and random VPLs on the two walls that meet it."""
    floor = np.concatenate(
        [random.uniform(0.0, 2.0, (receiver_count, 2)), np.zeros((receiver_count, 1))], axis=1
    )
    wall = np.concatenate([np.zeros((vpl_count, 1)), random.uniform(0.0, 2.0, (vpl_count, 2))], axis=1)
    on_other = np.arange(vpl_count) % 2 == 1
    wall[on_other] = wall[on_other][:, [1, 0, 2]]
    normals = np.where(on_other[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    flux = random.uniform(0.5, 1.5, (vpl_count, 3)) / vpl_count
    footprint = np.sqrt(8.0 / vpl_count / np.pi) * random.uniform(0.5, 2.0, vpl_count)

    def array(values: np.ndarray) -> jax.Array:
        return jnp.asarray(values, jnp.float32)

    up = np.tile([0.0, 0.0, 1.0], (receiver_count, 1))
    return (
        Receivers(array(floor), array(up)),
        VirtualPointLights(array(wall), array(normals), array(footprint), array(flux)),
    )
