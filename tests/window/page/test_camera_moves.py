"""The camera's moves and the projection, run in the browser against closed forms and NumPy.

Tolerances are 1e-9 of lengths near 1 unless a test says otherwise: double precision, some tens of operations.
"""

import itertools
import math

import numpy as np
import pytest

from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.views import View, ray_directions_world

CLOSE = 1e-9
ASPECT = 1.5


def camera_of(yaw, pitch, roll=0.0, eye=(0.3, 1.2, 4.0), yfov=0.9):
    """A camera turned about Y, X and Z; written here a second time, with NumPy."""
    (cy, sy), (cp, sp), (cr, sr) = ((math.cos(a), math.sin(a)) for a in (yaw, pitch, roll))
    heading = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    tilt = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    bank = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    to_world = np.eye(4)
    to_world[:3, :3] = heading @ tilt @ bank
    to_world[:3, 3] = eye
    return {"to_world": to_world.ravel().tolist(), "yfov": yfov}


def matrix(camera):
    return np.array(camera["to_world"]).reshape(4, 4)


def place_of(run_module, camera, point):
    return np.array(
        run_module("maths/projection.js", "return m.projected(...given).place", [camera, ASPECT, list(point)])
    )


@pytest.mark.parametrize("roll", [0.0, 0.4])
def test_a_point_projects_to_the_pixel_whose_ray_the_runtime_casts(run_module, roll):
    camera = camera_of(0.7, -0.3, roll)
    size = (6, 4)
    rays = ray_directions_world(View("", "fitted", size, Camera(matrix(camera), camera["yfov"]), ()))
    for row, column in ((0, 0), (1, 4), (3, 5)):
        point = matrix(camera)[:3, 3] + 2.5 * rays[row, column]
        centre = [(column + 0.5) / size[0], (row + 0.5) / size[1]]
        assert place_of(run_module, camera, point) == pytest.approx(centre, abs=CLOSE)
        ray = run_module("maths/projection.js", "return m.rayThrough(...given)", [camera, ASPECT, centre])
        unit = rays[row, column] / np.linalg.norm(rays[row, column])
        assert ray["direction"] == pytest.approx(unit, abs=CLOSE)


def test_angles_give_the_rotation_back(run_module):
    for angles in ((0.0, 0.0, 0.0), (2.9, -1.2, 0.3), (-1.7, 1.5, -3.0)):
        camera = camera_of(*angles)
        found = run_module("maths/camera.js", "return m.turnBy(m.anglesOf(given))", camera)
        assert np.reshape(found, (3, 3)) == pytest.approx(matrix(camera)[:3, :3], abs=CLOSE)


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_a_camera_that_looks_straight_up_or_down_keeps_its_heading(run_module, pitch):
    camera = camera_of(0.8, pitch)
    found = run_module("maths/camera.js", "return m.turnBy(m.anglesOf(given))", camera)
    # The sines of rounded right angles are off by 1e-16, and the test for straight down allows 1e-6.
    assert np.reshape(found, (3, 3)) == pytest.approx(matrix(camera)[:3, :3], abs=1e-6)


def test_an_orbit_keeps_the_pivot_in_place_and_up_upright(run_module):
    camera, pivot = camera_of(0.4, -0.2), [0.5, 0.7, -1.0]
    before = place_of(run_module, camera, pivot)
    for yaw, pitch in ((0.5, 0.2), (-1.0, -3.0), (2.0, 3.0)):
        turned = run_module("maths/camera.js", "return m.orbited(...given)", [camera, pivot, yaw, pitch])
        assert place_of(run_module, turned, pivot) == pytest.approx(before, abs=1e-8)
        distance = np.linalg.norm(matrix(turned)[:3, 3] - pivot)
        assert distance == pytest.approx(np.linalg.norm(matrix(camera)[:3, 3] - pivot), abs=CLOSE)
        # Up never points down, however far the pointer goes, and the horizon stays level.
        assert matrix(turned)[1, 1] > 0
        assert matrix(turned)[1, 0] == pytest.approx(0.0, abs=CLOSE)


def test_an_orbit_keeps_the_roll_of_a_camera(run_module):
    turned = run_module(
        "maths/camera.js", "return m.orbited(...given)", [camera_of(0, 0, 0.5), [0, 0, 0], 0.3, 0.1]
    )
    assert run_module("maths/camera.js", "return m.anglesOf(given).roll", turned) == pytest.approx(
        0.5, abs=CLOSE
    )


def test_a_pan_puts_the_surface_under_the_pointer(run_module):
    camera, point, place = camera_of(0.4, -0.2), [0.5, 0.7, -1.0], [0.8, 0.1]
    body = """
      const { rayThrough } = await import("/maths/projection.js");
      const [camera, point, place, aspect] = given;
      return m.panned(camera, point, rayThrough(camera, aspect, place).direction);
    """
    panned = run_module("maths/camera.js", body, [camera, point, place, ASPECT])
    assert place_of(run_module, panned, point) == pytest.approx(place, abs=CLOSE)
    assert matrix(panned)[:3, :3] == pytest.approx(matrix(camera)[:3, :3])


def test_the_wheel_never_passes_through_the_surface(run_module):
    camera, target = camera_of(0.0, 0.0, eye=(0, 0, 5)), [0.0, 0.0, 0.0]
    distances = run_module(
        "maths/camera.js",
        """let camera = given; const seen = [];
        for (let i = 0; i < 200; i += 1) {
          camera = m.dollied(camera, [0, 0, 0], 1, 10);
          seen.push(m.eyeOf(camera)[2]);
        }
        return seen;""",
        camera,
    )
    assert all(near <= far for far, near in itertools.pairwise(distances))
    # It ends a thousandth of the diagonal of 10 in front of the surface.
    assert distances[-1] == pytest.approx(0.01, rel=1e-6)
    back = run_module("maths/camera.js", "return m.eyeOf(m.dollied(given, [0, 0, 0], -1000, 10))[2]", camera)
    assert back == pytest.approx(200.0)
    assert run_module("maths/camera.js", "return m.dollied(...given)", [camera, target, 0, 10]) == camera


def test_framing_shows_every_corner_and_touches_the_sphere_about_the_box(run_module):
    bounds = [[-1, 0, -2], [3, 2, 2]]
    for aspect in (0.5, 2.0):
        framed = run_module(
            "maths/camera.js", "return m.framed(...given)", [camera_of(0.6, -0.5), bounds, aspect]
        )
        corners = [[bounds[i][0], bounds[j][1], bounds[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        places = [
            run_module("maths/projection.js", "return m.projected(...given).place", [framed, aspect, corner])
            for corner in corners
        ]
        assert np.all((np.array(places) > 0) & (np.array(places) < 1))
        centre = run_module(
            "maths/projection.js", "return m.projected(...given)", [framed, aspect, [1, 1, 0]]
        )
        assert centre["place"] == pytest.approx([0.5, 0.5], abs=CLOSE)
        half = math.atan(math.tan(0.45) * min(1, aspect))
        assert centre["depth"] == pytest.approx(3.0 / math.sin(half))  # half the diagonal is 3


def test_an_eased_move_begins_and_ends_where_it_should_and_stays_rigid(run_module):
    first, last = camera_of(3.0, 0.2), camera_of(-3.0, -0.4, eye=(2, 0, -1), yfov=0.5)
    between = [
        run_module("maths/camera.js", "return m.cameraBetween(...given)", [first, last, share])
        for share in (0.0, 0.5, 1.0)
    ]
    assert matrix(between[0]) == pytest.approx(matrix(first), abs=CLOSE)
    assert matrix(between[2]) == pytest.approx(matrix(last), abs=CLOSE)
    rotation = matrix(between[1])[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=CLOSE)
    # The short way from 172° to −172° is over 180°: it looks along +Z in the middle.
    assert rotation[2, 2] < -0.9


def test_a_segment_is_cut_at_the_eye_and_nothing_behind_is_drawn(run_module):
    camera = camera_of(0, 0, eye=(0, 0, 0))
    segment = "return m.projectedSegment(given, 1.5, ...%s)"
    assert run_module("maths/projection.js", segment % "[[0, 0, 1], [1, 0, 2]]", camera) is None
    ends = run_module("maths/projection.js", segment % "[[0, 0, 1], [0, 0, -1]]", camera)
    assert ends[1] == pytest.approx([0.5, 0.5], abs=CLOSE)
    assert np.all(np.isfinite(ends))
