"""A fit recovers bias and softness of visibility maps from the runtime's own images; gradients match."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import colored_room, room_view
from own_reference import own_reference

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_visibility import SPACE, overlap_nodes, reduce_visibility, residuals
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights, gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.vpl_visibility import (
    VisibilityParameters,
    map_texels,
    seen_share,
    surface_overlap,
)

PLANTED = ArtistParameters(
    intensity=1.3, falloff_footprint=1.0, vpl_count=256, visibility_bias=0.02, visibility_softness=0.2
)


def drawn_by_the_runtime(gl_context, light: str, parameters: ArtistParameters) -> CapturedView:
    """A view whose reference is the runtime's own image with known parameters."""
    view = room_view(light, (32, 24))
    config = TunedConfig(parameters, visibility="maps", quality=Quality(rsm_resolution=256), light=ONE_BOUNCE)
    captured = Runtime(colored_room(), context=gl_context).capture(view, config)
    return CapturedView(view, own_reference(captured), captured)


def test_recovery(gl_context):
    """β and σ are recovered within 5 %, the error of the grid, from starts 40 and 200 times smaller."""
    views = tuple(drawn_by_the_runtime(gl_context, light, PLANTED) for light in ("spot", "point"))
    start = replace(
        PLANTED,
        visibility_bias=ArtistParameters().visibility_bias,
        visibility_softness=ArtistParameters().visibility_softness,
    )
    found = fit_placement(views, start).parameters
    assert found.visibility_bias == pytest.approx(PLANTED.visibility_bias, rel=0.05)
    assert found.visibility_softness == pytest.approx(PLANTED.visibility_softness, rel=0.05)
    assert found.intensity == pytest.approx(PLANTED.intensity, rel=0.01)


def test_gradients_against_differences_of_the_drawn_image(gl_context):
    """dloss/dβ and dloss/dσ of the surrogate match central differences of the rendered image to 2 %.

    The steps are 1 % of each parameter. Pairs at the kinks of the clamp make the loss not quite smooth.
    """
    drawn = drawn_by_the_runtime(gl_context, "spot", PLANTED).captured
    valid = drawn.valid
    half = np.asarray(1.2 * drawn.indirect_irradiance[valid] + 0.01, np.float32)
    target = target_of(half, half)
    receivers, vpls = gather_inputs(drawn)
    overlap = surface_overlap(receivers, vpls, map_texels(drawn.visibility_maps))

    def surrogate_loss(bias, softness):
        seen = seen_share(overlap, VisibilityParameters(bias, softness))
        return weighted_squared_error(gather(receivers, vpls, FalloffParameters.of(PLANTED), seen), target)

    def drawn_loss(parameters: ArtistParameters) -> float:
        image = drawn_by_the_runtime(gl_context, "spot", parameters).captured.indirect_irradiance[valid]
        weight, mean = np.asarray(target.weight, np.float64), half.astype(np.float64)
        return float(np.sum(weight * (image - mean) ** 2))

    values = (PLANTED.visibility_bias, PLANTED.visibility_softness)
    gradients = jax.grad(surrogate_loss, argnums=(0, 1))(*map(jnp.float32, values))
    for name, value, gradient in zip(
        ("visibility_bias", "visibility_softness"), values, gradients, strict=True
    ):
        up, down = (drawn_loss(replace(PLANTED, **{name: value * factor})) for factor in (1.01, 0.99))
        assert float(gradient) == pytest.approx((up - down) / (0.02 * value), rel=0.02), name


def test_the_small_problem_is_the_whole_one():
    """The sum of the squared residuals is the loss over all pairs, to 1e-3, the error of the grid."""
    random = np.random.default_rng(3)
    receivers, vpls = _pairs(random)
    overlap = jnp.asarray(10.0 ** random.uniform(-5.0, 0.5, (64, 32)) * random.choice([-1, 1], (64, 32)))
    overlap = overlap.astype(jnp.float32)
    half = np.asarray(random.uniform(0.1, 1.0, (64, 3)), np.float32)
    falloff = FalloffParameters.of(PLANTED)
    reduced = reduce_visibility(receivers, vpls, overlap, target_of(half, half), falloff)
    for bias, softness in ((0.0005, 0.05), (0.02, 0.2), (0.1, 0.5)):
        chosen = replace(PLANTED, visibility_bias=bias, visibility_softness=softness)
        small = float(jnp.sum(residuals(jnp.asarray(SPACE.point(chosen)), (reduced,)) ** 2))
        image = gather(receivers, vpls, falloff, seen_share(overlap, VisibilityParameters.of(chosen)))
        whole = weighted_squared_error(image, target_of(half, half))
        assert small == pytest.approx(float(whole), rel=1e-3)
    assert np.all(np.diff(overlap_nodes()) > 0.0)


def _pairs(random):
    floor = np.concatenate([random.uniform(0, 2, (64, 2)), np.zeros((64, 1))], axis=1)
    above = np.concatenate([random.uniform(0, 2, (32, 2)), np.ones((32, 1))], axis=1)

    def array(values):
        return jnp.asarray(values, jnp.float32)

    return (
        Receivers(array(floor), array(np.tile([0.0, 0.0, 1.0], (64, 1)))),
        VirtualPointLights(
            array(above),
            array(np.tile([0.0, 0.0, -1.0], (32, 1))),
            array(np.full(32, 0.1)),
            array(random.uniform(0.5, 1.5, (32, 3))),
        ),
    )
