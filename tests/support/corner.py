"""A floor lit by VPLs on two walls, made without a renderer: input for tests of the surrogate's gather."""

import jax.numpy as jnp
import numpy as np

from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights


def corner(
    random: np.random.Generator, receiver_count: int, vpl_count: int
) -> tuple[Receivers, VirtualPointLights]:
    """Random receivers on a floor of 2 L × 2 L, and random VPLs on the two walls that meet it, in turn."""
    floor = np.pad(random.uniform(0.0, 2.0, (receiver_count, 2)), ((0, 0), (0, 1)))
    wall = np.pad(random.uniform(0.0, 2.0, (vpl_count, 2)), ((0, 0), (1, 0)))
    on_second = np.arange(vpl_count) % 2 == 1
    wall[on_second] = wall[on_second][:, [1, 0, 2]]
    normals = np.where(on_second[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    flux = random.uniform(0.5, 1.5, (vpl_count, 3)) / vpl_count
    # Discs of the walls' whole area, 8 L², then made up to twice as small or as large.
    footprint = np.sqrt(8.0 / vpl_count / np.pi) * random.uniform(0.5, 2.0, vpl_count)
    up = np.tile([0.0, 0.0, 1.0], (receiver_count, 1))
    floor, up, wall, normals, footprint, flux = (
        jnp.asarray(values, jnp.float32) for values in (floor, up, wall, normals, footprint, flux)
    )
    return Receivers(floor, up), VirtualPointLights(wall, normals, footprint, flux)
