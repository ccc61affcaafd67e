"""Sets of views: moved from the start, in free space, lit, and reproducible from the seed."""

import dataclasses

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from scene_paths import OWN_SCENES

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import views_for_scene
from vpltune.renderer.scene.placement.free_space import free_space, march_rays
from vpltune.renderer.scene.placement.sight import (
    light_hits,
    lit_fraction,
    mean_square_distance_world,
    seen_by,
)
from vpltune.renderer.scene.scene import scaled, scaled_camera, scaled_light

SIZE = (64, 48)


def views_of(path, seed=0, fitted=3, held_out=3, factor=1.0):
    scene = read_scene(path)
    camera = scaled_camera(scene.cameras[0], factor)
    lights = tuple(scaled_light(light, factor) for light in scene.lights)
    scene = scaled(scene, factor)
    return scene, views_for_scene(
        scene, camera, lights, fitted=fitted, held_out=held_out, size=SIZE, seed=seed
    )


def test_names_splits_and_the_first_view():
    scene, start = colored_room(), room_view()
    views = views_for_scene(scene, start.camera, start.lights, fitted=2, held_out=2, size=SIZE, seed=5)
    assert [view.name for view in views] == ["fitted_0", "fitted_1", "held_out_0", "held_out_1"]
    assert [view.split for view in views] == ["fitted", "fitted", "held_out", "held_out"]
    assert views[0].camera is start.camera and views[0].lights is start.lights
    assert all(view.size == SIZE for view in views)


@pytest.mark.parametrize(("fitted", "held_out"), [(0, 2), (1, -1)])
def test_counts_are_checked(fitted, held_out):
    scene, start = colored_room(), room_view()
    with pytest.raises(ValueError, match=r"fitted must be ≥ 1, validation and held_out ≥ 0, got"):
        views_for_scene(
            scene, start.camera, start.lights, fitted=fitted, held_out=held_out, size=SIZE, seed=0
        )


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_all_views_differ_in_camera_and_light(path):
    _, views = views_of(path)
    for i, first in enumerate(views):
        for second in views[i + 1 :]:
            assert np.abs(first.camera.to_world - second.camera.to_world).max() > 0.01
            a, b = first.lights[0], second.lights[0]
            moved = np.abs(a.position_world - b.position_world).max() > 0.0
            turned = np.abs(a.direction_world - b.direction_world).max() > 0.01
            assert turned or moved


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_views_stay_in_free_space_and_in_sight_of_the_start(path):
    scene, views = views_of(path, seed=3, fitted=4, held_out=4)
    space = free_space(scene)
    starts = [views[0].camera.position_world, views[0].lights[0].position_world]
    for view in views[1:]:
        placed = [view.camera.position_world]
        if view.lights[0].kind != "directional":
            placed.append(view.lights[0].position_world)
        for start, position in zip(starts, placed, strict=False):
            a, b = space.to_voxels(start), space.to_voxels(position)
            length = np.linalg.norm(b - a)
            assert space.clearance_at(b[None, :])[0] > 0.0
            if length > 0.0:
                assert march_rays(space, a[None, :], (b - a)[None, :] / length).distance[0] >= length - 1.0


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_every_view_sees_surfaces_and_light(path):
    scene, views = views_of(path, seed=11, fitted=4, held_out=4)
    space = free_space(scene)
    start = seen_by(space, views[0].camera)
    for view in views:
        sight = seen_by(space, view.camera)
        assert sight.hit_fraction >= min(0.6, 0.9 * start.hit_fraction)
        assert lit_fraction(space, sight, view.lights) >= 0.05


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_moved_lights_keep_kind_cones_and_irradiance(path):
    scene, views = views_of(path)
    space = free_space(scene)
    first = views[0].lights[0]
    for view in views[1:]:
        light = view.lights[0]
        assert (light.kind, light.inner_cone, light.outer_cone) == (
            first.kind,
            first.inner_cone,
            first.outer_cone,
        )
        assert np.linalg.norm(light.direction_world) == pytest.approx(1.0, abs=1e-9)
        if light.kind == "directional":
            assert np.array_equal(light.intensity, first.intensity)
            # SUN_TURN is 25 degrees.
            assert light.direction_world @ first.direction_world > np.cos(np.radians(25.0)) - 1e-9
            continue
        irradiance = light.intensity / mean_square_distance_world(space, light_hits(space, light))
        before = first.intensity / mean_square_distance_world(space, light_hits(space, first))
        assert irradiance == pytest.approx(before, rel=1e-9)


def test_the_range_of_a_moved_light_grows_as_its_distances_do():
    """Their squares are in the ratio of the intensities: the light gives what it gave, and ends as it did."""
    view = room_view("point")
    first = dataclasses.replace(view.lights[0], range=2.0)
    scene = colored_room()
    views = views_for_scene(scene, view.camera, (first,), fitted=3, held_out=0, size=SIZE, seed=0)
    lights = [other.lights[0] for other in views]
    assert len({light.range for light in lights}) == 3
    for light in lights:
        assert (light.range / 2.0) ** 2 == pytest.approx(light.intensity[0] / first.intensity[0], rel=1e-9)


def test_the_seed_decides_and_more_views_leave_the_others_alone():
    path = OWN_SCENES[0]
    _, some = views_of(path, seed=7, fitted=2, held_out=1)
    _, more = views_of(path, seed=7, fitted=3, held_out=2)
    _, other = views_of(path, seed=8, fitted=2, held_out=1)
    by_name = {view.name: view for view in more}
    for view in some:
        assert np.array_equal(view.camera.to_world, by_name[view.name].camera.to_world)
        assert np.array_equal(view.lights[0].position_world, by_name[view.name].lights[0].position_world)
    assert not np.array_equal(some[1].camera.to_world, other[1].camera.to_world)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_views_do_not_depend_on_scale(factor):
    path = next(path for path in OWN_SCENES if path.stem == "gallery")
    scene, views = views_of(path)
    _, views_scaled = views_of(path, factor=factor)
    size = factor * float(np.ptp(scene.bounds(), axis=0).max())
    for view, there in zip(views, views_scaled, strict=True):
        position = factor * view.camera.position_world
        assert np.abs(there.camera.position_world - position).max() < 1e-6 * size
        light = scaled_light(view.lights[0], factor)
        assert np.abs(there.lights[0].position_world - light.position_world).max() < 1e-6 * size
        assert there.lights[0].intensity == pytest.approx(light.intensity, rel=1e-5)
