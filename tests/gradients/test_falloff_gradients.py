"""Gradients against finite differences of the runtime's image, and against the gather pair by pair."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from corner import corner
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather, gather_pairwise

CELLS = ArtistParameters(vpl_count=64, lloyd_iterations=4, falloff_footprint=0.9, extinction_coefficient=0.6)
START = point_vpls(intensity=1.4, falloff_footprint=0.7, extinction_coefficient=0.6, vpl_count=256)
STEP = {"intensity": 0.05, "falloff_footprint": 0.05, "extinction_coefficient": 0.05}
WITHOUT_MAPS = TunedConfig(point_vpls(), visibility="transmittance", light=ONE_BOUNCE)


@jax.jit
def derivative_along(receivers, vpls, point, tangent):
    """Compiled once for all lights: they see the same pixels."""
    return jax.jvp(lambda at: gather(receivers, vpls, at), (point,), (tangent,))[1]


@pytest.mark.parametrize("start", [START, CELLS], ids=["points", "cells"])
@pytest.mark.parametrize("light", ROOM_LIGHTS)
@pytest.mark.parametrize("name", STEP)
def test_gradient_is_the_runtimes_own(gl_context, light, name, start):
    """The derivative of every pixel by each parameter matches central differences of the GLSL image.

    Central differences with step h err by h²/6 of the third derivative, about 1e-3 here, and float32 adds
    1e-6/h. So the cosine between the two derivative images is above 0.99999, and their norms agree to 0.3 %.
    For discs, edges pass over some receivers as α changes: with a thirtieth of the step, the bounds are 0.998
    and 3 %.
    """
    cells = start.lloyd_iterations > 0
    step = STEP[name] / (30.0 if cells and name == "falloff_footprint" else 1.0)
    runtime = Runtime(colored_room(), context=gl_context)
    images = []
    for sign in (-1.0, 1.0):
        moved = replace(start, **{name: getattr(start, name) + sign * step})
        captured = runtime.capture(room_view(light), WITHOUT_MAPS.with_parameters(moved))
        images.append(captured.indirect_irradiance[captured.valid].astype(np.float64))
    finite = (images[1] - images[0]) / (2.0 * step)

    receivers, vpls = gather_inputs(captured)
    point = FalloffParameters(*(jnp.float32(getattr(start, key)) for key in STEP))
    tangent = FalloffParameters(*(jnp.float32(key == name) for key in STEP))
    derivative = np.asarray(derivative_along(receivers, vpls, point, tangent), np.float64)
    cosine = np.sum(derivative * finite) / np.linalg.norm(derivative) / np.linalg.norm(finite)
    assert cosine > (0.998 if cells else 0.99999)
    assert np.linalg.norm(derivative) == pytest.approx(np.linalg.norm(finite), rel=3e-2 if cells else 3e-3)


def test_tabulated_gradient_follows_the_full_gather(gl_context):
    """The loss gradient through the table matches the full gather's to 2 % of the largest component.

    The table errs by up to 0.1 % in the image.
    """
    config = WITHOUT_MAPS.with_parameters(START)
    captured = Runtime(colored_room(), context=gl_context).capture(room_view("spot", (32, 24)), config)
    receivers, vpls = gather_inputs(captured)
    table = tabulate_gather(receivers, vpls)
    truth = np.asarray(gather(receivers, vpls, FalloffParameters(*map(jnp.float32, (0.9, 0.4, 0.3)))))
    target = target_of(truth, truth)
    space = SearchSpace()

    def loss(point, image_of):
        return weighted_squared_error(image_of(FalloffParameters(**space.values(point))), target)

    point = jnp.asarray(space.point(START), jnp.float32)
    full = jax.grad(lambda p: loss(p, lambda q: gather(receivers, vpls, q)))(point)
    fast = jax.grad(lambda p: loss(p, lambda q: gather_tabulated(table, q)))(point)
    np.testing.assert_allclose(fast, full, atol=0.02 * float(jnp.abs(full).max()))


@pytest.mark.parametrize("cells", [False, True], ids=["points", "cells"])
@pytest.mark.parametrize("moving", [("falloff",), ("falloff", "vpls")])
def test_gradient_of_the_gather_is_that_of_its_definition(moving, cells):
    """Forward and reverse derivatives of a weighted sum match those of the gather pair by pair.

    They agree to 1e-3 of the largest component: float32 in another order, and the edges of discs are steep.
    """
    receivers, vpls = corner(np.random.default_rng(3), 60, 30)
    vpls = replace(vpls, cells=cells)
    point = FalloffParameters(*map(jnp.float32, (1.3, 0.7, 0.6)))
    moved = {name: {"falloff": point, "vpls": vpls}[name] for name in moving}
    weights = jnp.asarray(np.random.default_rng(4).random((60, 3)), jnp.float32)

    def energy(function, moved):
        given = {"falloff": point, "vpls": vpls} | moved
        return jnp.sum(weights * function(receivers, given["vpls"], given["falloff"]))

    def derivatives(function):
        energy_of = partial(energy, function)
        return jax.jit(lambda at: (jax.grad(energy_of)(at), jax.jvp(energy_of, (at,), (at,))[1]))(moved)

    ours, exact = map(jax.tree.leaves, map(derivatives, (gather, gather_pairwise)))
    for value, expected in zip(ours, exact, strict=True):
        np.testing.assert_allclose(value, expected, rtol=0, atol=1e-3 * float(jnp.abs(expected).max()))


def test_the_gather_is_linear_in_visibility():
    """The derivative along the visibility itself is the image, and gradient · visibility is its sum."""
    receivers, vpls = corner(np.random.default_rng(3), 60, 30)
    point = FalloffParameters(*map(jnp.float32, (1.3, 0.7, 0.6)))
    seen = jnp.asarray(np.random.default_rng(4).random((60, 30)), jnp.float32)
    image, along = jax.jvp(lambda share: gather(receivers, vpls, point, share), (seen,), (seen,))
    np.testing.assert_allclose(along, image, rtol=1e-5)
    gradient = jax.grad(lambda share: gather(receivers, vpls, point, share).sum())(seen)
    assert float(jnp.sum(gradient * seen)) == pytest.approx(float(image.sum()), rel=1e-5)


def test_gradient_is_finite_where_receiver_and_vpl_coincide():
    """The hard cases for quotients and roots: d = 0, α at its bounds, κ = 0."""
    from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights

    receivers = Receivers(jnp.zeros((4, 3)), jnp.tile(jnp.array([0.0, 1.0, 0.0]), (4, 1)))
    vpls = VirtualPointLights(
        jnp.zeros((2, 3)), jnp.tile(jnp.array([0.0, -1.0, 0.0]), (2, 1)), jnp.full(2, 0.1), jnp.ones((2, 3))
    )
    for alpha in (0.05, 20.0):
        point = FalloffParameters(jnp.float32(1.0), jnp.float32(alpha), jnp.float32(0.0))
        for image in (gather, lambda r, v, p: gather_tabulated(tabulate_gather(r, v), p)):
            gradient = jax.grad(lambda p, f=image: f(receivers, vpls, p).sum())(point)
            assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(gradient))
