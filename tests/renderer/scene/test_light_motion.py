"""Bouncing lights stay in free space, conserve energy, and depend on time and seed alone."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room

from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BRIGHTNESS, GRAVITY, SPOT_CONE, BouncingLights, flux_beside
from vpltune.renderer.scene.placement.free_space import free_space
from vpltune.renderer.scene.placement.sight import light_hits
from vpltune.renderer.scene.scene import scaled, scaled_light


def energy(lights: BouncingLights) -> np.ndarray:
    """Kinetic plus potential energy of each light per unit mass, in voxels² per second²."""
    gravity = GRAVITY * max(lights._space.shape)
    return 0.5 * (lights._velocity**2).sum(axis=1) + gravity * (lights._position[:, 1] - lights._low[1])


def test_lights_stay_in_free_space():
    """In 30 seconds no light enters an occupied voxel or leaves the scene's bounds, and all lights move."""
    scene = colored_room()
    lights, space = BouncingLights(scene, 500, 0, 10.0), free_space(scene)
    start = lights.records["position_world"].copy()
    low, high = scene.bounds()
    for _ in range(30):
        lights.advance(1.0)
        voxel = np.floor(lights._position)
        assert not space.occupied[tuple(voxel.astype(int).T)].any()
        positions = lights.records["position_world"]
        assert (positions >= low - 1e-6).all()
        assert (positions <= high + 1e-6).all()
    assert (np.linalg.norm(positions - start, axis=1) > 0.01).all()


def test_energy_is_kept():
    """Bounces are elastic: in 20 s the mean energy changes by less than 1 %, that of any light by 10 %.

    Single lights change more because a light that skims a surface gets a little speed to leave it.
    """
    lights = BouncingLights(colored_room(), 500, 1, 10.0)
    start = energy(lights)
    lights.advance(20.0)
    end = energy(lights)
    assert end.mean() == pytest.approx(start.mean(), rel=1e-2)
    np.testing.assert_allclose(end, start, rtol=0.1)


def test_time_steps_do_not_matter():
    """One second in 1, 7 or 100 steps gives the same positions, up to rounding of the sum of steps."""
    positions = []
    for steps in (1, 7, 100):
        lights = BouncingLights(colored_room(), 200, 2, 10.0)
        for _ in range(steps):
            lights.advance(1.0 / steps)
        positions.append(lights.records["position_world"].copy())
    for other in positions[1:]:
        np.testing.assert_allclose(other, positions[0], atol=1e-5)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_motion_is_that_of_the_scaled_scene(factor):
    """Positions and ranges scale with the scene, intensities with its square, so irradiance is kept."""
    plain = BouncingLights(colored_room(), 100, 3, 10.0)
    grown = BouncingLights(scaled(colored_room(), factor), 100, 3, 10.0 * factor**2)
    for lights in (plain, grown):
        lights.advance(3.0)
    for name, power in (("position_world", 1), ("range", 1), ("intensity", 2), ("direction_world", 0)):
        np.testing.assert_allclose(
            grown.records[name], plain.records[name] * factor**power, rtol=1e-4, atol=1e-4 * factor**power
        )


def test_a_seed_repeats_and_another_does_not():
    one, same, other = (BouncingLights(colored_room(), 50, seed, 10.0).records for seed in (4, 4, 5))
    np.testing.assert_array_equal(one, same)
    assert (one["position_world"] != other["position_world"]).any()


def test_flux_is_what_was_asked_for():
    """A point light emits 4πI, a spot 2π(1 − cos outer)I. Each light gets an equal share of `flux`."""
    lights = DynamicLights(BouncingLights(colored_room(), 80, 6, 25.0).records)
    assert (lights.point_count, lights.spot_count) == (60, 20)
    solid_angle = np.full(80, 4.0 * np.pi)
    solid_angle[60:] = 2.0 * np.pi * (1.0 - np.cos(SPOT_CONE[1]))
    flux = lights.numbers[:, 4:7] * solid_angle[:, None]
    np.testing.assert_allclose(flux.mean(axis=1), 25.0 / 80, rtol=1e-5)


def test_no_light_is_no_trouble():
    lights = BouncingLights(colored_room(), 0, 0, 1.0)
    lights.advance(1.0)
    assert len(lights.records) == 0


def test_flux_beside_a_view_grows_with_its_lights_and_with_the_scene():
    """Flux is proportional to light and to the square of scale. Without lights it stands for π W/m²."""
    scene = colored_room()
    for light in ROOM_LIGHTS.values():
        plain = flux_beside(scene, (light,))
        assert flux_beside(scene, (light, light)) == pytest.approx(2.0 * plain)
        grown = flux_beside(scaled(scene, 10.0), (scaled_light(light, 10.0),))
        assert grown == pytest.approx(100.0 * plain, rel=1e-4)
    area = sum(4.0 for _ in range(5)) + np.linalg.norm(np.cross([0.7, 0.5, 0.0], [0.0, 0.05, 0.7]))
    assert flux_beside(scene, ()) == pytest.approx(BRIGHTNESS * np.pi * area, rel=1e-2)


def test_flux_beside_a_light_follows_its_range():
    """At the RMS distance d of the surfaces within range, 1 − (d/range)⁴ of the light is left."""
    scene = colored_room()
    light = replace(ROOM_LIGHTS["spot"], range=np.inf)
    hits, space = light_hits(free_space(scene), light), free_space(scene)
    distance = hits.distance[hits.hit] * space.voxel_world
    endless = flux_beside(scene, (light,))
    for end in (1.5 * distance.max(), float(np.median(distance))):
        square = (distance[distance < end] ** 2).mean()
        expected = endless * (distance**2).mean() / square * (1.0 - square**2 / end**4)
        assert flux_beside(scene, (replace(light, range=float(end)),)) == pytest.approx(expected)
        assert expected != pytest.approx(endless, rel=0.01)
    # No surface is within range: as without lights.
    assert flux_beside(scene, (replace(light, range=1e-3),)) == flux_beside(scene, ())
