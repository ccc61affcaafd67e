"""Glowing surfaces and skies against Mitsuba's own path tracer, at the same pixels, bounce by bounce."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from vpltune.renderer.scene.environment import Environment, texel_directions
from vpltune.renderer.scene.scene import Material
from vpltune.tuner.reference import reference_views

SIGNIFICANCE = 0.01
"""Probability of a false alarm in an image, of all pixel tests together. A choice."""
SHARE_THAT_PASSES = 0.9975
"""Share of the pixels that must pass. A choice."""
DEPTH_OF_ALL = 24
"""Vertices of the plain paths for all bounces. The room's walls reflect 0.73 at most, and it is open: what
is left out is below 1e-4."""


def sky_radiance(directions: np.ndarray) -> np.ndarray:
    """A blue sky with a broad, warm sun to the upper right in front of the room."""
    up = directions[..., 1:2]
    toward = directions @ (np.array([0.4, 0.5, 0.77]) / np.linalg.norm([0.4, 0.5, 0.77]))
    sun = np.exp(8.0 * (toward[..., None] - 1.0)) * [6.0, 5.0, 3.5]
    return (1.2 + up) * [0.2, 0.3, 0.5] + sun


def lit_scene(shapes, kind: str):
    """The box room with a panel under its ceiling, a sky, or both; and the sky of the plain path tracer."""
    room = shapes.box_room()
    if kind != "sky":
        lamp = Material("lamp", np.full(3, 0.2, np.float32), emission=(9.0, 8.0, 6.0))
        panel = shapes.quad_mesh([-0.35, 1.9, -0.2], [0.6, 0, 0], [0, 0, 0.5], 3, "panel")
        added = shapes.scene_of([*room.meshes, panel], [*room.materials, lamp])
        room = replace(added, instances=(*room.instances, added.instances[-1]))
    if kind == "panel":
        return room, None
    sky = Environment(sky_radiance(texel_directions(256, 512)).astype(np.float32))
    return replace(room, environment=sky), sky_radiance


@pytest.mark.parametrize(
    ("kind", "bounces"),
    [
        ("panel and sky", 1),
        *(
            pytest.param(kind, bounces, marks=pytest.mark.slow)
            for kind in ("panel", "sky")
            for bounces in (1, 2, 3, None)
        ),
    ],
)
def test_box_room(mitsuba, shapes, kind, bounces):
    """Depth 2 is emitted and direct light; one more for each bounce."""
    quick = kind == "panel and sky"
    size, samples = ((20, 15), 1024) if quick else ((40, 30), 4096)
    scene, sky = lit_scene(shapes, kind)
    view = shapes.box_room_view(size, ())
    view = replace(view, lights=())
    ours = reference_views(scene, (view,), noise_target=0.0, max_samples=samples, bounces=bounces)[0]
    valid = ours.valid
    seen = ours.emission[valid]
    direct = seen + (ours.direct_irradiance * ours.albedo / np.pi)[valid]
    whole = direct + (ours.irradiance * ours.albedo / np.pi)[valid]
    own = ((ours.irradiance_a - ours.irradiance_b) * ours.albedo / np.pi)[valid] ** 2 / 4.0
    depth = DEPTH_OF_ALL if bounces is None else bounces + 2
    for right, wanted in ((2, direct), (depth, whole)):
        plain, variance = (
            image[valid]
            for image in shapes.plain_path_trace(mitsuba, scene, view, right, samples, right, sky)
        )
        # As in test_path_trace_agreement: our own noise, over the image, and a floor for dark pixels.
        variance = variance * (1.0 + own.sum() / variance.sum()) + (1e-3 * wanted.mean()) ** 2
        scores = (plain - wanted) / np.sqrt(variance)
        threshold = norm.isf((1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / scores.size)) / 2.0)
        passed = np.mean((np.abs(scores) < threshold).all(axis=1))
        assert passed >= SHARE_THAT_PASSES, f"depth {right}: {passed:.4%}, z to {np.abs(scores).max():.1f}"
        reflected = wanted - seen
        assert (plain - seen).sum() / reflected.sum() == pytest.approx(1.0, abs=0.005), right
