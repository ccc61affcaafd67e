"""What dragging a handle means: rays against axes, planes, spheres and cones, in closed form.

Tolerances are 1e-9 of lengths near 1: double precision, some tens of operations.
"""

import math

import numpy as np
import pytest

CLOSE = 1e-9


def drags(run_module, body, argument=None):
    return run_module("maths/gizmo_drags.js", body, argument)


def ray(origin, towards):
    direction = np.subtract(towards, origin)
    return {"origin": list(origin), "direction": (direction / np.linalg.norm(direction)).tolist()}


def test_the_nearest_point_of_an_axis_is_the_one_that_the_ray_passes(run_module):
    axis, point = np.array([0.6, 0.8, 0.0]), np.array([1.0, 2.0, 3.0])
    for s in (-2.0, 0.5, 4.0):
        # Aside of the axis, at right angles to it and to the ray: the nearest point stays the same.
        target = point + s * axis
        origin = np.array([5.0, 1.0, 9.0])
        across = np.cross(axis, target - origin)
        given = [ray(origin + 0.3 * across, target + 0.3 * across), point.tolist(), axis.tolist()]
        assert drags(run_module, "return m.nearestOnAxis(...given)", given) == pytest.approx(s, abs=CLOSE)


def test_an_axis_seen_from_its_end_does_not_move(run_module):
    given = [ray([0, 0, 5], [0.1, 0, 0]), [0, 0, 0], [0, 0, 1]]
    assert drags(run_module, "return m.nearestOnAxis(...given)", given) is None


def test_a_plane_is_met_in_front_of_the_eye_only(run_module):
    plane = [[0, 0, -1], [0, 0, 1]]
    assert drags(
        run_module, "return m.onPlane(...given)", [ray([0, 0, 1], [1, 2, 0]), *plane]
    ) == pytest.approx([2, 4, -1])
    assert drags(run_module, "return m.onPlane(...given)", [ray([0, 0, 1], [0, 0, 2]), *plane]) is None
    assert drags(run_module, "return m.onPlane(...given)", [ray([0, 0, 1], [1, 0, 1]), *plane]) is None


def test_a_sphere_is_entered_and_left_and_its_rim_stands_in_beside_it(run_module):
    hit = drags(run_module, "return m.onSphere(...given)", [ray([0.6, 0, 5], [0.6, 0, 0]), [0, 0, 0], 1.0])
    assert hit["near"] == pytest.approx([0.6, 0, 0.8], abs=CLOSE)
    assert hit["far"] == pytest.approx([0.6, 0, -0.8], abs=CLOSE)
    beside = drags(run_module, "return m.onSphere(...given)", [ray([0, 3, 5], [0, 3, 0]), [0, 0, 0], 1.0])
    assert beside["missed"]
    assert beside["near"] == pytest.approx([0, 1, 0], abs=CLOSE)


def test_a_direction_stays_on_its_side_until_it_goes_round_the_rim(run_module):
    body = """
      const [start, ...steps] = given;
      const drag = new m.DirectionDrag(start, [0, 0, 0], 1, [0, 0, -1]);
      return steps.map((ray) => drag.moved(ray));
    """
    eye = [0, 0, 10]
    rays = [ray(eye, [x, 0, 0]) for x in (0.0, 0.1, 0.5, 3.0, 0.5, 0.1)]
    depths = [direction[2] for direction in drags(run_module, body, rays)]
    assert depths[0] < 0
    assert depths[1] < 0
    assert depths[3] > 0
    assert depths[4] > 0


def test_a_cone_goes_through_the_pointer(run_module):
    axis, apex = [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]
    for angle in (0.2, 0.9, 1.5):
        rim = [math.sin(angle), 0, -math.cos(angle)]
        given = [ray([0, 5, 3], rim), apex, 1.0, axis, angle]
        assert drags(run_module, "return m.coneThrough(...given)", given) == pytest.approx(angle, abs=1e-7)


def test_cones_keep_the_rule_of_the_file_format(run_module):
    allowed = "return m.allowedCones(...given)"
    assert drags(run_module, allowed, [0.3, 0.2, "outer_cone"]) == {"inner_cone": 0.2, "outer_cone": 0.2}
    assert drags(run_module, allowed, [0.5, 0.2, "inner_cone"]) == {"inner_cone": 0.5, "outer_cone": 0.5}
    widest = drags(run_module, allowed, [0.3, 9.0, "outer_cone"])
    assert widest == {"inner_cone": 0.3, "outer_cone": math.pi / 2}
    assert drags(run_module, allowed, [0.3, -1.0, "outer_cone"])["outer_cone"] > 0


def test_a_circle_of_a_cone_lies_on_cone_and_sphere(run_module):
    axis = np.array([0.48, -0.6, 0.64])
    points = run_module(
        "stage/light_gizmo.js", "return m.coneCircle(...given)", [[1, 2, 3], axis.tolist(), 0.7, 2.0]
    )
    spokes = np.array(points) - [1, 2, 3]
    assert np.linalg.norm(spokes, axis=1) == pytest.approx(2.0, abs=CLOSE)
    assert spokes @ axis / 2.0 == pytest.approx(math.cos(0.7), abs=CLOSE)
