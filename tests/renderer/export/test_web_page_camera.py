"""The exported page's camera, moved by real mouse and keys: it passes through no surface."""

import dataclasses

import numpy as np
import pytest
import trimesh
from built_scenes import quad, room_view, scene_of
from exported_frames import CONFIG, with_parameters, with_resolution
from exported_page import page_text

from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at

SMALL = with_resolution(with_parameters(CONFIG, vpl_count=8), 64)
GRAY = [(0.6, 0.6, 0.6)]
EYE = "vpltune.orbit.eye"


def box(low, high):
    """The six sides of a box."""
    low, high = np.array(low, float), np.array(high, float)
    x, y, z = np.diag(high - low)
    corners = ((low, x, y), (low, y, z), (low, z, x), (high, -x, -y), (high, -y, -z), (high, -z, -x))
    return [quad(*corner) for corner in corners]


ROOM = scene_of(
    [*box((-1, -1, -1), (1, 1, 1)), *box((0.3, -1, -0.2), (0.6, 1, 0.2))], GRAY, "room with a pillar"
)
BLOCK = scene_of(box((-1, -1, -1), (1, 1, 1)), GRAY, "block")
MARGIN = 0.002 * np.sqrt(12.0)
"""How near the eye may come to a surface of either."""


def page_from(opened, scene, eye, target=(0.0, 0.0, 0.0), light="spot"):
    camera = Camera(look_at(np.array(eye, float), np.array(target, float)), np.radians(50.0))
    view = dataclasses.replace(room_view(light, (16, 12)), camera=camera)
    return opened(page_text(scene, view, SMALL))


def drag(page, right, down):
    """Drag the image with the mouse, by shares of its width and height."""
    area = page.locator("#image").bounding_box()
    x, y = area["x"] + area["width"] / 2, area["y"] + area["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right * area["width"], y + down * area["height"], steps=8)
    page.mouse.up()


def test_clearance_is_the_distance_to_the_nearest_triangle(opened):
    """Against trimesh, which tries every triangle; to 1e-9, as both compute in doubles. Seed 5.

    One piece has no area: it is a line, whose distance has a closed form.
    """
    random = np.random.default_rng(5)
    pieces = [quad(origin, u / 5, v / 5) for origin, u, v in random.uniform(-1.0, 1.0, (100, 3, 3))]
    line = np.array([[x, 0.25, 0.5] for x in (0.125, 0.25, 0.875, 0.5)], np.float32)
    scene = scene_of([*pieces, dataclasses.replace(pieces[0], positions=line)], GRAY)
    page = page_from(opened, scene, (0.0, 0.0, 4.0))
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in pieces]).astype(float)
    # The first points lie close to the line, which is then nearest.
    points = random.uniform(-1.5, 1.5, (50, 3))
    points[:5] = np.array([0.25, 0.26, 0.5]) + random.uniform(-0.01, 0.01, (5, 3))
    found = page.evaluate("points => points.map((one) => vpltune.surfaces.clearance(one))", points.tolist())
    expected = []
    for point in points:
        nearest = trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1)))
        on_line = np.array([np.clip(point[0], 0.125, 0.875), 0.25, 0.5])
        expected.append(np.linalg.norm(np.vstack([nearest, on_line]) - point, axis=1).min())
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_eye_stays_in_a_closed_room_and_out_of_its_pillar(opened, seed):
    """Drags, wheel and keys ask for more than the room has. Rounding may take 1e-5 of the margin."""
    page = page_from(opened, ROOM, (-0.4, 0.1, 0.7), light="point")
    random = np.random.default_rng(seed)
    least = MARGIN * (1.0 - 1e-5)
    closest = np.inf
    for _ in range(12):
        before = page.evaluate(EYE)
        drag(page, *random.uniform(-0.9, 0.9, 2))
        page.mouse.wheel(0, int(random.choice([-3000, 3000])))
        for key in random.choice(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-"], 6):
            page.keyboard.press(str(key))
        eye = np.array(page.evaluate(EYE))
        assert (eye != before).any()
        assert np.abs(eye).max() <= 1.0 - least
        aside = np.linalg.norm(np.maximum(np.abs(eye[[0, 2]] - [0.45, 0.0]) - [0.15, 0.2], 0.0))
        assert aside >= least
        closest = min(closest, aside, 1.0 - np.abs(eye).max())
    # It was held in by a surface, not by want of movement: a step ends within a third of the margin.
    assert closest < 4.0 / 3.0 * MARGIN


@pytest.mark.parametrize("eye", [(3.0, 1.0, 3.0), (0.0, 0.5, -6.0)])
def test_an_open_object_is_orbited_all_round(opened, eye):
    """At one distance, to rounding; the wheel stops in front of it, and moves away without an end."""
    page = page_from(opened, BLOCK, eye)
    distance = np.linalg.norm(eye)
    places = []
    for _ in range(8):
        drag(page, 0.25, 0.0)
        places.append(page.evaluate(EYE))
    # A drag across the image is 4 rad; there are seven quarters of it between the first place and the last.
    angles = np.unwrap([np.arctan2(x, z) for x, _, z in places])
    assert abs(angles[-1] - angles[0]) == pytest.approx(7.0, abs=0.3)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), distance, rtol=1e-9)
    for _ in range(80):
        page.keyboard.press("-")
    assert page.evaluate("vpltune.orbit.distance") == pytest.approx(distance * 1.07**80, rel=1e-6)
    for _ in range(40):
        page.mouse.wheel(0, -3000)
    near = np.array(page.evaluate(EYE))
    outside = np.linalg.norm(np.maximum(np.abs(near) - 1.0, 0.0))
    assert MARGIN * (1.0 - 1e-5) <= outside < 4.0 / 3.0 * MARGIN


def test_a_wall_holds_the_eye_in_and_lets_it_out_again(opened):
    """A quarter turn in a room narrower than the orbit, and back: to 1e-6, the rounding of 100 turns."""
    room = scene_of(box((-0.5, -1, -2), (0.5, 1, 2)), GRAY, "corridor")
    page = page_from(opened, room, (0.0, 0.0, 1.8), light="point")
    start = np.array(page.evaluate("vpltune.camera"))
    for _ in range(31):
        page.keyboard.press("ArrowRight")
    aside = np.array(page.evaluate(EYE))
    assert abs(aside[0]) == pytest.approx(0.5, abs=2.0 * 0.002 * np.sqrt(21.0))
    assert abs(aside[2]) < 0.1
    for _ in range(31):
        page.keyboard.press("ArrowLeft")
    for _ in range(20):
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("ArrowRight")
    np.testing.assert_allclose(page.evaluate("vpltune.camera"), start, atol=1e-6)


def test_a_camera_that_starts_too_near_a_wall_can_leave_it(opened):
    page = page_from(opened, ROOM, (-0.4, 0.1, 1.0 - 1e-5), light="point")
    page.keyboard.press("-")
    assert np.abs(page.evaluate(EYE)).max() <= 1.0 - 0.99e-5
    for _ in range(5):
        page.keyboard.press("+")
    eye = np.array(page.evaluate(EYE))
    assert 1.0 - np.abs(eye).max() > MARGIN


def test_the_camera_stops_before_it_is_upside_down(opened):
    page = page_from(opened, BLOCK, (0.0, 1.0, 6.0))
    for key, side in (("ArrowUp", 1.0), ("ArrowDown", -1.0)):
        for _ in range(80):
            page.keyboard.press(key)
        backward, up = (np.array(page.evaluate("vpltune.camera"))[:3, i] for i in (2, 1))
        assert up[1] > 0.0
        # A step of 0.05 rad less than the limit of 0.98.
        assert 0.96 < side * backward[1] <= 0.98
