"""Rays pass through holes, wherever the texture has them."""

from dataclasses import replace

import numpy as np
import pytest
from card_over_floor import card_over_floor, checkered
from traced_rays import hierarchy_of, ray_tracer

from vpltune.renderer.gpu.ray_hierarchy import RAY_READS
from vpltune.renderer.scene.scene import Texture

TEXELS = np.random.default_rng(5).integers(0, 256, (5, 7)).astype(np.uint8)


def hits_of_card(gl_context, texture, uv_scale=1.0, opacity=1.0):
    """Coordinates where 4,000 rays straight down cross the card, and whether each meets it."""
    scene = card_over_floor("mask", opacity, texture)
    card = replace(scene.meshes[1], uv=uv_scale * scene.meshes[1].uv)
    scene = replace(scene, meshes=(scene.meshes[0], card))
    hierarchy, _ = hierarchy_of(gl_context, scene)
    assert hierarchy.reads != RAY_READS
    places = np.random.default_rng(6).uniform(-1, 1, (4000, 2))
    origins = np.column_stack([places[:, 0], np.full(4000, 2.0), places[:, 1]]).astype(np.float32)
    distances, is_met = ray_tracer(gl_context, hierarchy)(
        hierarchy, origins, np.tile(np.float32([0, -1, 0]), (4000, 1))
    )
    assert is_met.all()
    np.testing.assert_allclose(distances, np.where(distances < 1.75, 1.5, 2.0), rtol=1e-6)
    return uv_scale * 0.5 * (places + 1.0), distances < 1.75


@pytest.mark.parametrize(
    ("wrap", "scale", "folded"),
    [
        ("repeat", 3.0, lambda c: c % 1.0),
        ("mirrored_repeat", 3.0, lambda c: 1.0 - np.abs(c % 2.0 - 1.0)),
        ("clamp_to_edge", 1.5, lambda c: np.minimum(c, 0.999)),
    ],
)
def test_a_ray_meets_the_texels_that_are_there(gl_context, wrap, scale, folded):
    """Up to rays within 1e-4 of a texel's edge, where float32 decides."""
    texture = Texture("t", np.full((5, 7, 3), 255, np.uint8), wrap, wrap, TEXELS)
    uv, is_met = hits_of_card(gl_context, texture, scale)
    column, row = folded(uv[:, 0]) * 7, folded(uv[:, 1]) * 5
    expected = TEXELS[np.minimum(row.astype(int), 4), np.minimum(column.astype(int), 6)] >= 127.5
    clear = (np.abs(column - np.round(column)) > 1e-4) & (np.abs(row - np.round(row)) > 1e-4)
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(is_met[clear], expected[clear])


def test_the_factor_counts(gl_context):
    """Half of 255 is below a cutoff of a half in no texel, and of 0.9 of it in all."""
    _, is_met = hits_of_card(gl_context, checkered(), opacity=0.51)
    assert 0.4 < is_met.mean() < 0.6
    _, is_met = hits_of_card(gl_context, checkered(), opacity=0.49)
    assert not is_met.any()
