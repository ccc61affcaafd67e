"""The reference's lights end at their range, at any scale; without a range keys stay."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.scene.scene import Light, scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.reference import reference_views
from vpltune.tuner.reference.content_key import reference_key

ENDLESS = {"seed": 0, "noise_target": 0.1, "max_samples": 64, "bounces": 1, "variant": "llvm_ad_rgb"}


@pytest.fixture
def floor(shapes):
    """A square of 4 m at y = 0 that faces up, with reflectance 0.5."""
    return shapes.scene_of([shapes.quad_mesh([-2, 0, -2], [0, 0, 4], [4, 0, 0])], [shapes.gray(0.5)])


def lamp(height: float, reach: float = np.inf) -> Light:
    return Light("point", [3.0, 2.0, 1.0], [0.0, height, 0.0], range=reach)


def reference(scene, view, **changes):
    return reference_views(
        scene, (view,), **{"noise_target": 0.0, "max_samples": 64, "bounces": 1} | changes
    )[0]


def expected_on_floor(got, light: Light) -> np.ndarray:
    """I cos θ max(1 − (d/range)⁴, 0)/d² on a floor that faces up."""
    to_light = light.position_world - got.position_world
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    return (
        light.intensity * to_light[..., 1:2] / distance**3 * np.maximum(1 - (distance / light.range) ** 4, 0)
    )


@pytest.mark.parametrize("height", [0.3, 1.0, 1.4, 1.5, 2.0])
def test_direct_light_ends_at_the_range(shapes, floor, height):
    """To 1e-5 of it, and 1e-6 of the brightest where little is left: the estimator is of single precision."""
    light = lamp(height, 1.5)
    got = reference(floor, shapes.view_of((0.1, 3, 2), (0, 0, 0), [light]))
    expected = expected_on_floor(got, light)
    assert got.valid.all()
    np.testing.assert_allclose(got.direct_irradiance, expected, rtol=1e-5, atol=1e-6 * 3.0 / height**2)
    beyond = np.linalg.norm(light.position_world - got.position_world, axis=-1) > 1.5001
    assert (got.direct_irradiance[beyond] == 0.0).all()
    assert (got.direct_irradiance > 0.0).any() == (height < 1.5)


def test_reflected_light_is_of_what_is_left(shapes):
    """A patch of 0.2 m at 0.9 ranges, over a black floor: 1 − 0.9⁴ of what it reflects without a range.

    To 1 %: at the patch's corners, 1 % farther than its middle, (d/range)⁴ is 4 % larger, and in the mean
    over it 1.3 %, which is 2.5 % of what is left; so the mean over the patch is taken.
    """
    patch = shapes.quad_mesh([-0.1, 1, -0.1], [0.2, 0, 0], [0, 0, 0.2], 1, "patch")
    floor = shapes.quad_mesh([-2, 0, -2], [0, 0, 4], [4, 0, 0], 0, "floor")
    scene = shapes.scene_of([floor, patch], [shapes.gray(0.0), shapes.gray(0.8)])
    reach = (1.0 - 1e-3) / 0.9
    got, plain = (
        reference(
            scene,
            shapes.view_of((0.1, 0.5, 1.5), (0, 0, 0), [lamp(1e-3, each)], yfov=0.3),
            max_samples=4096,
        )
        for each in (reach, np.inf)
    )
    across = (np.arange(32) + 0.5) / 32 * 0.2 - 0.1
    distance = np.sqrt(across[:, None] ** 2 + across[None, :] ** 2 + (1.0 - 1e-3) ** 2)
    left = (1.0 - (distance / reach) ** 4).mean()
    assert got.irradiance.mean() / plain.irradiance.mean() == pytest.approx(left, rel=0.01)


def test_a_range_grows_with_the_scene(shapes):
    """Unit space is the same at any scale, so both halves agree to the rounding of positions, 1e-4."""
    scene = shapes.box_room()
    view = shapes.box_room_view(
        (16, 12), (replace(shapes.spot(), range=2.0), replace(shapes.point(), range=1.0))
    )
    small = reference(scene, view, max_samples=16, bounces=None)
    large = reference(scaled(scene, 100.0), scaled_view(view, 100.0), max_samples=16, bounces=None)
    plain = reference(scene, shapes.box_room_view((16, 12), (shapes.spot(), shapes.point())), max_samples=16)
    assert small.direct_irradiance.mean() < 0.9 * plain.direct_irradiance.mean()
    np.testing.assert_allclose(small.direct_irradiance, large.direct_irradiance, rtol=1e-3, atol=1e-4)
    assert small.irradiance.mean() == pytest.approx(large.irradiance.mean(), rel=1e-3)


def test_a_range_makes_another_key_and_none_makes_that_of_before(shapes, monkeypatch):
    """The key of a light without a range is the hash of the members that lights have always had."""
    monkeypatch.setattr("importlib.metadata.version", lambda package: "3")
    plain = shapes.view_of((0.1, 3, 2), (0, 0, 0), [lamp(1.0)])
    ended = shapes.view_of((0.1, 3, 2), (0, 0, 0), [lamp(1.0, 1.5)])
    farther = shapes.view_of((0.1, 3, 2), (0, 0, 0), [lamp(1.0, 1.6)])
    keys = {reference_key("scene", view, **ENDLESS) for view in (plain, ended, farther)}
    assert len(keys) == 3
    content = {
        "scene": "scene",
        "camera": [plain.camera.to_world.ravel().tolist(), plain.camera.yfov],
        "lights": [
            {
                "type": "point",
                "position": [0.0, 1.0, 0.0],
                "direction": [0.0, 0.0, -1.0],
                "intensity": [3.0, 2.0, 1.0],
                "inner_cone": 0.0,
                "outer_cone": float(np.pi / 4),
            }
        ],
        "size": list(plain.size),
        **ENDLESS,
        "mitsuba": "3",
        "estimator": 2,
    }
    before = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    assert reference_key("scene", plain, **ENDLESS) == before
