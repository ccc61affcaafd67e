"""The mean of a texture over each triangle, and the equal pieces that triangles are cut into."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import quad, scene_of

from vpltune.renderer.scene.scene import Texture
from vpltune.renderer.scene.triangle_albedo import triangle_albedo
from vpltune.renderer.scene.triangle_texels import equal_pieces, mean_stopped_texels, mean_texels

BLACK, WHITE = (0, 0, 0), (255, 255, 255)
CORNERS = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]]])


def texture_of(texels, opacity=None, wrap="repeat") -> Texture:
    image = np.array(texels, np.uint8)
    holes = None if opacity is None else np.array(opacity, np.uint8)
    return Texture("stripes", image, opacity=holes, wrap_u=wrap, wrap_v=wrap)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_pieces_are_equal_and_keep_the_winding(count):
    corners = equal_pieces(count)[..., 1:]
    (a, b, c) = (corners[:, k] for k in range(3))
    (x, y), (z, w) = (b - a).T, (c - a).T
    # Half the cross product: a triangle of area 1/2 in count² parts. Sums of doubles near 1.
    np.testing.assert_allclose((x * w - y * z) / 2.0, 0.5 / count**2, rtol=1e-12)
    np.testing.assert_allclose(equal_pieces(count).mean(axis=(0, 1)), 1.0 / 3.0, rtol=1e-12)


def test_an_even_texture_has_its_colour_everywhere():
    even = texture_of([[(255, 0, 188)]])
    # 188 is 0.5029 in linear light (IEC 61966-2-1).
    np.testing.assert_allclose(mean_texels(even, 40.0 * CORNERS - 7.0), [[1.0, 0.0, 0.5029]] * 2, atol=1e-4)


def test_halves_of_a_texture_count_by_area():
    """The left half is white. The first triangle has 3/4 of its area in it, the second 1/4."""
    means = mean_texels(texture_of([[WHITE, BLACK]]), CORNERS)
    np.testing.assert_allclose(means, [[0.75] * 3, [0.25] * 3], atol=0.07)


@pytest.mark.parametrize("tiles", [4, 15.5, 16, 31, 32, 93, 100, 124])
def test_a_tiled_floor_has_the_mean_of_its_tiles(tiles):
    """Two triangles with chequers of two by two texels, so often. 16 places that keep step with them see one
    colour alone. To 0.05: 1,024 places at random would have 0.016."""
    chequers = texture_of([[WHITE, BLACK], [BLACK, WHITE]])
    np.testing.assert_allclose(mean_texels(chequers, tiles * CORNERS), 0.5, atol=0.05)


@pytest.mark.parametrize(
    ("wrap", "expected"), [("repeat", 1.0), ("mirrored_repeat", 0.0), ("clamp_to_edge", 0.0)]
)
def test_places_beyond_the_edge_follow_the_wrap_mode(wrap, expected):
    """All of the triangle lies between u = 1 and 1.5, where a repeated texture begins with white again."""
    beyond = np.array([[[1.05, 0.2], [1.45, 0.2], [1.05, 0.8]]])
    assert mean_texels(texture_of([[WHITE, BLACK]], wrap=wrap), beyond) == pytest.approx(expected)


@pytest.mark.parametrize(("mode", "expected"), [("opaque", 0.5), ("mask", 1.0), ("blend", 1.0)])
def test_holes_count_for_nothing(mode, expected):
    """Black is under the hole of a masked or a blended surface; one that is opaque has no holes."""
    scene = scene_of([quad((0, 0, 0), (1, 0, 0), (0, 1, 0))], [(1.0, 1.0, 1.0)], "leaf")
    material = replace(scene.materials[0], texture=0, alpha_mode=mode)
    leaf = texture_of([[WHITE, BLACK]], [[255, 0]])
    mesh = replace(scene.meshes[0], uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    scene = replace(scene, materials=(material,), textures=(leaf,), meshes=(mesh,))
    assert triangle_albedo(scene, mesh).mean() == pytest.approx(expected, abs=0.07)


@pytest.mark.parametrize(("mode", "expected"), [("opaque", 1.0), ("mask", 0.5), ("blend", 0.45)])
def test_a_hole_emits_nothing(mode, expected):
    """The right half of the base texture is a hole, the left nine tenths opaque. So is half of a white glow,
    and none of one that is white on the left alone. Two triangles share the square: to 0.07, as above."""
    scene = scene_of([quad((0, 0, 0), (1, 0, 0), (0, 1, 0))], [(1.0, 1.0, 1.0)], "sign")
    material = replace(scene.materials[0], texture=0, alpha_mode=mode)
    base = texture_of([[WHITE, WHITE]], [[230, 0]])
    for glow, seen in ((None, expected), (texture_of([[WHITE, BLACK]]), min(expected, 0.5))):
        means = mean_stopped_texels(glow, CORNERS, material, base)
        np.testing.assert_allclose(means.mean(axis=0), seen, atol=0.07)
