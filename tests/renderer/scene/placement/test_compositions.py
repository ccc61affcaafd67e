"""What placed views show: the subject in its own grid, surfaces, albedo, and bounced light."""

import math

import numpy as np
import pytest
from built_scenes import quad, scene_of
from scene_paths import OWN_SCENES

from benchmarks.harness.hard_scenes import hard_scenes
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import default_camera, default_light
from vpltune.renderer.scene.placement.bounced_light import bounce_score
from vpltune.renderer.scene.placement.composition import composition
from vpltune.renderer.scene.placement.free_space import free_space
from vpltune.renderer.scene.placement.rasterised_surfaces import placed_triangles, triangles_in_box
from vpltune.renderer.scene.placement.sight import lit_fraction, seen_by
from vpltune.renderer.scene.placement.subject import space_of_view, subject_space
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.transforms import look_at

HARD = hard_scenes()
SUBJECT = np.array([310.0, 0.5, -420.0])
"""Middle of the furniture on the plane of 2 km, which is about 3 wide and 1.6 high."""


def test_a_small_subject_gets_its_own_grid():
    """A voxel of the 2 km plane is 2000/128 = 16; about the subject it is below a tenth."""
    scene = HARD["object-on-2-km-plane"]()
    assert free_space(scene).voxel_world > 15.0
    space = subject_space(scene)
    assert space.voxel_world < 0.1
    middle = space.to_voxels(SUBJECT)
    assert (middle > 0.0).all() and (middle < np.array(space.shape)).all()


def test_a_scene_that_is_its_own_subject_keeps_its_grid():
    scene = read_scene(next(path for path in OWN_SCENES if path.stem == "cornell-box"))
    assert subject_space(scene) is free_space(scene)


def test_a_small_subject_fills_the_image():
    scene = HARD["object-on-2-km-plane"]()
    camera, _ = default_camera(scene)
    away = np.linalg.norm(camera.position_world - SUBJECT)
    # It is 3 wide: at a distance of 9 and 40° it takes half the width of a 4:3 image or more.
    assert 2.0 < away < 9.0
    assert -camera.to_world[:3, 2] @ (SUBJECT - camera.position_world) / away > math.cos(math.radians(12.0))
    light, _ = default_light(scene, camera)
    space = space_of_view(scene, camera)
    assert 0.25 < lit_fraction(space, seen_by(space, camera), (light,)) < 0.75


def test_a_camera_far_from_the_subject_has_the_grid_of_the_scene():
    scene = HARD["object-on-2-km-plane"]()
    far = Camera(look_at(np.array([-900.0, 50.0, 900.0]), SUBJECT), 1.0)
    assert space_of_view(scene, far) is free_space(scene)


def test_a_room_in_terrain_is_seen_from_inside():
    scene = HARD["room-in-terrain"]()
    camera, note = default_camera(scene)
    assert "inside" in note
    assert (np.abs(camera.position_world) < [2.5, 2.6, 2.2]).all()


def test_triangles_are_cut_to_a_box():
    """A square of 2 km about a box of 4 m: pieces are at most 4 m long and cover the 16 m² in the box."""
    square = scene_of([quad([-1000, 0, -1000], [0, 0, 2000], [2000, 0, 0])], [(0.5, 0.5, 0.5)])
    low, high = np.array([100.0, -1.0, 50.0]), np.array([104.0, 1.0, 54.0])
    pieces = triangles_in_box(placed_triangles(square), low, high).corners
    assert np.ptp(pieces, axis=1).max() <= 4.0
    area = 0.5 * np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1)
    # Pieces of 2 to 4 m reach out of the box by at most their length on each side.
    assert 16.0 <= area.sum() <= 12.0**2


def test_choices_do_not_depend_on_the_origin():
    """Moved by powers of two, which float64 adds exactly; placement rounds to 10⁻⁵ voxels."""
    here, there = HARD["table-top"](), HARD["table-top"]()
    shift = np.array([1024.0, -256.0, 4096.0])
    for instance in there.instances:
        instance.to_world[:3, 3] += shift
    camera, moved = default_camera(here)[0], default_camera(there)[0]
    assert moved.position_world - shift == pytest.approx(camera.position_world, abs=1e-5)
    light, moved_light = default_light(here, camera)[0], default_light(there, moved)[0]
    assert moved_light.position_world - shift == pytest.approx(light.position_world, abs=1e-5)


def test_voxels_know_their_albedo():
    left = quad([-1, 0, -1], [0, 0, 2], [0.999, 0, 0], 0)
    right = quad([0.001, 0, -1], [0, 0, 2], [0.999, 0, 0], 1)
    space = free_space(scene_of([left, right], [(0.8, 0.1, 0.2), (0.1, 0.6, 0.3)]))
    x = space.to_world(np.argwhere(space.occupied) + 0.5)[:, 0]
    colors = space.albedo[space.occupied]
    # Rounded to 0.001; the voxels at the border hold both.
    assert np.abs(colors[x < -0.1] - [0.8, 0.1, 0.2]).max() < 1e-3
    assert np.abs(colors[x > 0.1] - [0.1, 0.6, 0.3]).max() < 1e-3


def test_one_wall_is_one_surface_and_two_halves_are_two():
    """Effective numbers exp(−Σ p log p) of one and of two equal shares, up to the rays on the border."""
    camera = Camera(look_at(np.array([0.0, 0.0, 3.0]), np.zeros(3)), 1.0)
    halves = [quad([-4, -4, 0], [4, 0, 0], [0, 8, 0], 0), quad([0, -4, 0], [4, 0, 0], [0, 8, 0], 1)]
    red, green = (0.7, 0.1, 0.1), (0.1, 0.7, 0.1)
    one, two = (
        composition(free_space(scene_of(halves, colors)), camera, 0.0)
        for colors in ([red, red], [red, green])
    )
    assert (one.surfaces, one.largest, one.hit) == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)
    assert two.surfaces == pytest.approx(2.0, abs=0.4)
    assert two.largest == pytest.approx(0.5, abs=0.1)


def test_bounced_light_counts_for_more_from_a_coloured_wall():
    """A spot on one wall of a box: red bleeds, white is bright and has no colour, black gives nothing."""
    scores = []
    for color in ((0.8, 0.1, 0.1), (0.8, 0.8, 0.8), (0.0, 0.0, 0.0)):
        walls = [
            quad([-1, -1, -1], [0, 2, 0], [0, 0, 2], 0),
            quad([-1, -1, -1], [0, 0, 2], [2, 0, 0], 1),
            quad([-1, -1, -1], [2, 0, 0], [0, 2, 0], 1),
            quad([1, -1, -1], [0, 0, 2], [0, 2, 0], 1),
        ]
        space = free_space(scene_of(walls, [color, (0.7, 0.7, 0.7)]))
        camera = Camera(look_at(np.array([0.0, 0.0, 3.0]), np.zeros(3)), 0.8)
        left = np.array([-1.0, 0.0, 0.0])
        light = Light("spot", np.ones(3), np.array([0.5, 0.0, 0.0]), left, 0.2, 0.5)
        eye = space.to_voxels(camera.position_world)
        scores.append(bounce_score(space, seen_by(space, camera), eye, light))
    assert scores[0] > 1.1 * scores[1] > scores[2]
    # LEAST_VISIBLE · LEAST_COLORED: no bounced light at all.
    assert scores[2] == pytest.approx(0.02)
