"""The loss table of a view against the loss itself, and its gradient against finite differences."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.metrics.robust_error import robust_error
from vpltune.tuner.prior.loss_table import (
    BIAS_PLACES,
    FOOTPRINT_PLACES,
    HIGHEST_POINT,
    LOWEST_POINT,
    RECEIVERS,
    SOFTNESS_PLACES,
    LossTable,
    default_point,
    loss_table,
    table_loss,
)
from vpltune.tuner.reference.reference_view import ReferenceView
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.vpl_visibility import map_visibility

PARAMETERS = ArtistParameters(vpl_count=32)


@pytest.fixture(scope="module")
def view(gl_context) -> CapturedView:
    """A room whose reference is the runtime's own image with other parameters, with noise in both halves."""
    gl_context.__enter__()
    truth = replace(PARAMETERS, intensity=1.4, falloff_footprint=1.5)
    quality = Quality(rsm_resolution=128)
    # The bound on what lies between nodes was measured with the VPLs of one bounce.
    config = TunedConfig(truth, visibility="maps", quality=quality, light=ONE_BOUNCE)
    drawn = Runtime(colored_room(), context=gl_context).capture(room_view(), config)
    noise = np.random.default_rng(0).normal(1.0, 0.05, (2, *drawn.indirect_irradiance.shape))
    halves = (drawn.indirect_irradiance * noise).astype(np.float32)
    reference = ReferenceView(
        halves[0],
        halves[1],
        drawn.direct_irradiance,
        drawn.albedo,
        drawn.position_world.astype(np.float64),
        drawn.normal_world,
        drawn.valid,
        1,
    )
    return CapturedView(room_view(), reference, drawn)


@pytest.fixture(scope="module")
def table(view) -> LossTable:
    return jax.tree.map(jnp.asarray, loss_table(view, PARAMETERS, seed=0))


def direct_loss(view: CapturedView, point: np.ndarray) -> float:
    """The loss at a point of the unit cube, by the gather over all pairs."""
    values = {n: parameter_spec(n).within(float(p)) for n, p in zip(AUTO_PARAMETERS, point, strict=True)}
    parameters = replace(PARAMETERS, **values)
    pixels = view.fitted_pixels(RECEIVERS, 0)
    receivers, vpls = gather_inputs(view.captured, pixels)
    seen = map_visibility(view.captured, receivers, vpls, parameters)
    flat = np.flatnonzero(view.captured.valid.ravel())[pixels]
    halves = (view.reference.irradiance_a, view.reference.irradiance_b)
    images = (view.reference.irradiance, view.reference.direct_irradiance, view.captured.indirect_irradiance)
    reference, direct, drawn = (image.reshape(-1, 3)[flat] for image in images)
    weight = robust_error(reference, direct, drawn).weights(drawn)
    target = target_of(*(half.reshape(-1, 3)[flat] for half in halves), weight)
    image = gather(receivers, vpls, FalloffParameters.of(parameters), seen)
    return float(weighted_squared_error(image, target))


@pytest.mark.parametrize("seed", range(3))
def test_exact_at_nodes(view, table, seed):
    """At the nodes, only the order of summation differs."""
    random = np.random.default_rng(seed)
    axes = (FOOTPRINT_PLACES, BIAS_PLACES, SOFTNESS_PLACES)
    point = np.array([0.5, *(random.choice(places) for places in axes)], np.float32)
    assert float(table_loss(table, point)) == pytest.approx(direct_loss(view, point), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_near_between_them(view, table, seed):
    """Between nodes the table is within 5 %: β and σ are interpolated linearly between coarse nodes."""
    point = np.random.default_rng(seed).uniform(LOWEST_POINT, HIGHEST_POINT).astype(np.float32)
    assert float(table_loss(table, point)) == pytest.approx(direct_loss(view, point), rel=5e-2, abs=1e-2)


def test_gradient(table):
    """The gradient matches central differences, away from the nodes, where the linear pieces have kinks."""
    point = jnp.array([0.52, 0.47, 0.07, 0.6], jnp.float32)
    gradient = jax.grad(lambda p: table_loss(table, p))(point)
    for axis in range(4):
        step = jnp.zeros(4).at[axis].set(2e-3)
        slope = (table_loss(table, point + step) - table_loss(table, point - step)) / 4e-3
        assert float(gradient[axis]) == pytest.approx(float(slope), rel=2e-2, abs=2e-2)


def test_the_defaults_lie_in_the_table():
    point = default_point(ArtistParameters())
    assert (point >= LOWEST_POINT).all() and (point <= HIGHEST_POINT).all()
