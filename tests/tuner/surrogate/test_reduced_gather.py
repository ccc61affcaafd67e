"""The small least-squares problem of a view gives the same loss as all its receivers."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.surrogate.reduced_gather import reduce_gather, reduced_image
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters


@pytest.fixture(scope="module")
def view():
    """1,500 receivers on a floor under 40 VPLs, and a noisy reference of its image."""
    random = np.random.default_rng(3)
    floor = np.concatenate([random.uniform(-1.0, 1.0, (1500, 2)), np.zeros((1500, 1))], axis=1)
    ceiling = np.concatenate([random.uniform(-1.0, 1.0, (40, 2)), np.ones((40, 1))], axis=1)

    def array(values):
        return jnp.asarray(values, jnp.float32)

    receivers = Receivers(array(floor), array(np.tile([0.0, 0.0, 1.0], (1500, 1))))
    vpls = VirtualPointLights(
        array(ceiling),
        array(np.tile([0.0, 0.0, -1.0], (40, 1))),
        array(random.uniform(0.05, 0.3, 40)),
        array(random.uniform(0.0, 1.0, (40, 3))),
    )
    table = tabulate_gather(receivers, vpls)
    image = np.asarray(gather_tabulated(table, parameters(0.9, 1.5, 0.4)))
    halves = [
        (image * (1.0 + 0.2 * random.standard_normal(image.shape))).astype(np.float32) for _ in range(2)
    ]
    return table, halves


def parameters(*values):
    return FalloffParameters(*map(jnp.float32, values))


@pytest.mark.parametrize("values", [(1.0, 0.5, 0.0), (0.9, 1.5, 0.4), (0.05, 20.0, 8.0), (20.0, 0.05, 0.0)])
def test_same_loss(view, values):
    """They agree to 2e-6 of the squared size of image and target, since both sum 4,500 float32 products."""
    table, halves = view
    target = target_of(*halves)
    reduced = reduce_gather(table, target)
    image = reduced_image(reduced, parameters(*values))
    small = float(jnp.sum((image - reduced.target) ** 2) + reduced.offset)
    full = float(weighted_squared_error(gather_tabulated(table, parameters(*values)), target))
    size = float(jnp.sum(image**2) + jnp.sum(reduced.target**2))
    assert small == pytest.approx(full, abs=2e-6 * size)


def test_a_black_view_is_all_zero(view):
    table, halves = view
    reduced = reduce_gather(table, target_of(*(np.zeros_like(half) for half in halves)))
    assert not np.any(reduced.factor)
    assert not np.any(reduced.target)
    assert float(reduced.offset) == 0.0


def test_what_is_not_finite_stays_so(view):
    """NaN must not turn into a black view."""
    table, halves = view
    broken = replace(table, irradiance=table.irradiance.at[7, 0, 3].set(jnp.nan))
    assert np.isnan(reduce_gather(broken, target_of(*halves)).factor).any()
