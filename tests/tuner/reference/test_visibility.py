"""Ray-traced visibility against an occluder whose shadow is known."""

import numpy as np
import pytest

from vpltune.renderer.scene.scene import scaled
from vpltune.tuner.reference import ray_traced_visibility

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture
def screen_between_floors(shapes):
    """Floor at y = 0, ceiling at y = 2, and a screen at y = 1 that covers x > 0."""
    return shapes.scene_of(
        [
            shapes.quad_mesh([-2, 0, -2], [0, 0, 4], [4, 0, 0], name="floor"),
            shapes.quad_mesh([-2, 2, -2], [4, 0, 0], [0, 0, 4], name="ceiling"),
            shapes.quad_mesh([0, 1, -2], [2, 0, 0], [0, 0, 4], name="screen"),
        ],
        [shapes.gray(0.5)],
    )


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_screen(screen_between_floors, factor):
    rng = np.random.default_rng(0)
    receivers = np.column_stack([rng.uniform(-2, 2, 500), np.zeros(500), rng.uniform(-2, 2, 500)])
    vpls = np.column_stack([rng.uniform(-2, 2, 300), np.full(300, 2.0), rng.uniform(-2, 2, 300)])
    crossing = (receivers[:, None, 0] + vpls[None, :, 0]) / 2.0
    got = ray_traced_visibility(
        scaled(screen_between_floors, factor),
        (receivers * factor).astype(np.float32),
        np.tile(UP, (500, 1)).astype(np.float32),
        (vpls * factor).astype(np.float32),
        np.tile(-UP, (300, 1)).astype(np.float32),
    )
    clear = np.abs(crossing) > 1e-3
    assert np.array_equal(got[clear], (crossing < 0.0)[clear])


def test_points_of_one_convex_room_see_each_other(shapes):
    """No surface occludes its own points, however close they are to a corner."""
    scene = shapes.scene_of(
        [
            shapes.quad_mesh([0, 0, 0], [0, 0, 1], [1, 0, 0], name="floor"),
            shapes.quad_mesh([0, 0, 0], [0, 1, 0], [0, 0, 1], name="wall"),
        ],
        [shapes.gray(0.5)],
    )
    rng = np.random.default_rng(1)
    near = 10.0 ** rng.uniform(-3, 0, 400)
    floor = np.column_stack([near, np.zeros(400), rng.uniform(0.01, 0.99, 400)])
    wall = np.column_stack([np.zeros(400), near, rng.uniform(0.01, 0.99, 400)])
    got = ray_traced_visibility(scene, floor, np.tile(UP, (400, 1)), wall, np.tile([1.0, 0.0, 0.0], (400, 1)))
    assert got.all()
    # With the normals of the floor reversed, no pair sees each other.
    assert not ray_traced_visibility(
        scene, floor, np.tile(-UP, (400, 1)), wall, np.tile([1.0, 0.0, 0.0], (400, 1))
    ).any()


@pytest.mark.parametrize(("x", "seen"), [(-0.7, True), (0.2, False)])
def test_a_disc_is_seen_by_the_part_over_the_horizon(screen_between_floors, x, seen):
    """A receiver that faces along +x, 1.5 above a disc of the floor, whose middle is 0.1 behind it.

    The middle of the part in sight is 0.2 in front of it. The screen is in the way where x > 0.
    """
    receiver, center = np.array([[x, 1.5, 0.0]]), np.array([[x - 0.1, 0.0, 0.0]])
    ends = receiver, np.array([[1.0, 0.0, 0.0]]), center, UP[None]
    assert not ray_traced_visibility(screen_between_floors, *ends).any()
    assert ray_traced_visibility(screen_between_floors, *ends, np.array([0.5])).all() == seen
    # A disc that does not reach the horizon.
    assert not ray_traced_visibility(screen_between_floors, *ends, np.array([0.09])).any()


@pytest.mark.parametrize(("receivers", "vpls"), [(1, 1), (3, 5), (7, 9), (1, 17)])
def test_pairs_that_fill_no_whole_packet(screen_between_floors, receivers, vpls):
    """A processor runs 4 to 16 lanes at once. Padding lanes after the last pair must not crash it."""
    left = np.linspace(-1.9, -0.1, receivers)[:, None] * [1.0, 0.0, 0.0]
    above = np.linspace(-1.9, -0.1, vpls)[:, None] * [1.0, 0.0, 0.0] + 2.0 * UP
    got = ray_traced_visibility(
        screen_between_floors, left, np.tile(UP, (receivers, 1)), above, np.tile(-UP, (vpls, 1))
    )
    assert got.shape == (receivers, vpls)
    assert got.all()


def test_nothing_asked_nothing_seen(screen_between_floors):
    none, one = np.zeros((0, 3)), np.zeros((1, 3))
    assert ray_traced_visibility(screen_between_floors, none, none, one, one).shape == (0, 1)
    assert ray_traced_visibility(screen_between_floors, one, one, none, none).shape == (1, 0)
