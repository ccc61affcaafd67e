"""The estimator against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.scene.scene import Light, Material, Texture
from vpltune.tuner.reference import ReferenceView, reference_views

DOWN = np.array([0.0, -1.0, 0.0])


@pytest.fixture
def floor(shapes):
    """A square of 4 m at y = 0 that faces up, with reflectance 0.5."""
    return shapes.scene_of([shapes.quad_mesh([-2, 0, -2], [0, 0, 4], [4, 0, 0])], [shapes.gray(0.5)])


def reference(scene, view, **changes) -> ReferenceView:
    return reference_views(
        scene, (view,), **{"noise_target": 0.0, "max_samples": 64, "bounces": 1} | changes
    )[0]


def test_direct_point_light_is_inverse_square(shapes, floor):
    light = Light("point", np.array([3.0, 2.0, 1.0]), position_world=np.array([0.0, 1.5, 0.0]))
    got = reference(floor, shapes.view_of((0.1, 3, 2), (0, 0, 0), [light]))
    to_light = light.position_world - got.position_world
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    expected = light.intensity * to_light[..., 1:2] / distance**3
    assert got.valid.all()
    # The estimator works in single precision.
    np.testing.assert_allclose(got.direct_irradiance, expected, rtol=1e-5)


@pytest.mark.parametrize(("inner", "outer"), [(0.0, 0.5), (0.3, 0.9), (0.6999, 0.7), (0.0, np.pi / 2)])
def test_spot_falloff_is_gltf_s(shapes, floor, inner, outer):
    light = shapes.spot(
        position_world=np.array([0.0, 1.0, 0.0]), direction_world=DOWN, inner_cone=inner, outer_cone=outer
    )
    got = reference(floor, shapes.view_of((0.1, 2.5, 1.5), (0, 0, 0), [light], size=(32, 32), yfov=1.0))
    to_light = light.position_world - got.position_world
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    cosine = to_light[..., 1:2] / distance
    falloff = np.clip((cosine - np.cos(outer)) / (np.cos(inner) - np.cos(outer)), 0.0, 1.0) ** 2
    # A hard edge amplifies the rounding of the cosine by 1/(cos inner − cos outer).
    tolerance = 1e-5 + 1e-6 / (np.cos(inner) - np.cos(outer))
    expected = light.intensity * falloff * cosine / distance**2
    assert got.valid.mean() > 0.8
    np.testing.assert_allclose(
        got.direct_irradiance[got.valid], expected[got.valid], rtol=1e-5, atol=10.0 * tolerance
    )


def test_directional_light_is_a_cosine(shapes, floor):
    light = shapes.sun()
    got = reference(floor, shapes.view_of((0.1, 3, 2), (0, 0, 0), [light]))
    expected = np.broadcast_to(light.intensity * -light.direction_world[1], got.albedo.shape)
    np.testing.assert_allclose(got.direct_irradiance, expected, rtol=1e-5)


@pytest.fixture
def wall_over_floor(shapes):
    """A square of 0.2 m at y = 1 that faces down, over a black floor that faces up."""

    def make(reflectance=0.8, tilt=0.0):
        half = 0.1
        up = [half * 2 * np.cos(tilt), half * 2 * np.sin(tilt), 0]
        patch = shapes.quad_mesh([-half, 1, -half], up, [0, 0, 2 * half], 1, "patch")
        floor = shapes.quad_mesh([-2, 0, -2], [0, 0, 4], [4, 0, 0], 0, "floor")
        return shapes.scene_of([floor, patch], [shapes.gray(0.0), shapes.gray(reflectance)])

    return make


def patch_form_factor(position: np.ndarray) -> np.ndarray:
    """∫ cos θ cos θ' / (π d²) dA over the patch of `wall_over_floor`, for receivers on its floor."""
    steps = (np.arange(32) + 0.5) / 32 * 0.2 - 0.1
    across = position[..., 0, None, None] - steps[:, None]
    along = position[..., 2, None, None] - steps[None, :]
    return np.mean(1.0 / (across**2 + along**2 + 1.0) ** 2, axis=(-2, -1)) * 0.04 / np.pi


def test_a_lit_patch_lights_a_black_floor_by_its_form_factor(shapes, wall_over_floor):
    """E = ρ·E⊥·F, on receivers with albedo 0."""
    light = Light("directional", np.array([2.0, 1.0, 0.5]), direction_world=-DOWN)
    # A directional light from below is blocked by the floor.
    scene = wall_over_floor()
    blocked = reference(scene, shapes.view_of((0.1, 0.5, 1.5), (0, 0, 0), [light]))
    assert blocked.irradiance[blocked.valid].max() == 0.0

    light = Light("point", np.array([2.0, 1.0, 0.5]), position_world=np.array([0.0, 1e-3, 0.0]))
    got = reference(scene, shapes.view_of((0.1, 0.5, 1.5), (0, 0, 0), [light], yfov=0.3), max_samples=16384)
    assert got.valid.all() and (got.albedo == 0.0).all()
    # The patch is 0.2 m wide and 1 m away, so its irradiance is I/d² within 2 %.
    expected = 0.8 * light.intensity * patch_form_factor(got.position_world)[..., None]
    assert got.irradiance.mean() == pytest.approx(expected.mean(), rel=0.02)
    np.testing.assert_allclose(got.irradiance.mean(axis=2), expected.mean(axis=2), rtol=0.06)


def test_surfaces_are_two_sided_but_light_does_not_pass_through(shapes, wall_over_floor):
    """Flipping the patch changes nothing. Lighting it from its far side leaves the floor in shadow."""
    light = Light("point", np.array([1.0, 1.0, 1.0]), position_world=np.array([0.0, 0.5, 0.0]))
    view = shapes.view_of((0.1, 0.5, 1.5), (0, 0, 0), [light])
    scene = wall_over_floor()
    patch = scene.meshes[1]
    turned = replace(patch, normals=-patch.normals, triangles=patch.triangles[:, ::-1].copy())
    over = replace(scene, meshes=(scene.meshes[0], turned))
    # The flipped triangles list their corners in another order, so they round differently.
    np.testing.assert_allclose(
        reference(scene, view).irradiance_a, reference(over, view).irradiance_a, rtol=1e-4
    )

    above = replace(light, position_world=np.array([0.0, 1.5, 0.0]))
    shadow = reference(scene, shapes.view_of((0.1, 0.5, 1.5), (0, 0, 0), [above]))
    assert shadow.irradiance.max() == 0.0
    under_the_patch = np.linalg.norm(shadow.position_world[..., ::2], axis=-1) < 0.1
    assert under_the_patch.any()
    assert shadow.direct_irradiance[under_the_patch].max() == 0.0


def test_a_floor_seen_from_below_is_lit_from_below(shapes, floor):
    light = Light("point", np.array([3.0, 2.0, 1.0]), position_world=np.array([0.0, -1.5, 0.0]))
    below = reference(floor, shapes.view_of((0.1, -3, 2), (0, 0, 0), [light]))
    above = reference(floor, shapes.view_of((0.1, 3, 2), (0, 0, 0), [light]))
    assert below.direct_irradiance.min() > 0.0
    assert above.direct_irradiance.max() == 0.0
    assert (below.normal_world[..., 1] == -1.0).all()


def ball(shapes, reflectance):
    """A sphere of radius 1 about the origin, 32 × 64 quads, with the exact normals of the sphere."""
    polar = np.linspace(0.0, np.pi, 33)
    around = np.linspace(0.0, 2.0 * np.pi, 65)
    points = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.broadcast_to(np.cos(polar)[:, None], (33, 65)),
            np.sin(polar)[:, None] * np.sin(around),
        ],
        axis=-1,
    ).reshape(-1, 3)
    corner = (np.arange(32)[:, None] * 65 + np.arange(64)).ravel()
    triangles = np.concatenate(
        [np.stack([corner, corner + 1, corner + 65], 1), np.stack([corner + 1, corner + 66, corner + 65], 1)]
    )
    template = shapes.quad_mesh([0, 0, 0], [1, 0, 0], [0, 1, 0])
    mesh = replace(
        template,
        positions=points.astype(np.float32),
        normals=points.astype(np.float32),
        uv=np.zeros((len(points), 2), np.float32),
        colors=np.ones((len(points), 3), np.float32),
        triangles=triangles.astype(np.int32),
    )
    return shapes.scene_of([mesh], [shapes.gray(reflectance)])


@pytest.mark.parametrize(("bounces", "series"), [(1, 0.5), (2, 0.75), (None, 1.0)])
def test_a_furnace_gives_the_geometric_series(shapes, bounces, series):
    """Inside a sphere lit from its centre, E_direct = I. One bounce gives ρ·I, all together ρ/(1 − ρ)·I.

    For ρ = 1/2 that is I/2 for one bounce, 3/4·I for two, and I for all.
    """
    light = Light("point", np.array([2.0, 3.0, 4.0]))
    view = shapes.view_of((0.3, 0.1, 0.2), (-1, 0.3, 0), [light], size=(16, 16))
    got = reference(ball(shapes, 0.5), view, bounces=bounces, max_samples=256)
    assert got.valid.all()
    # The facets are inside the sphere, by up to 1 − cos(π/64) in both directions, 0.24 % of the radius. So
    # the irradiance exceeds I by up to 0.5 %, and by as much again after a reflection.
    np.testing.assert_allclose(got.direct_irradiance.mean(axis=(0, 1)), light.intensity, rtol=5e-3)
    np.testing.assert_allclose(got.irradiance.mean(axis=(0, 1)), series * light.intensity, rtol=1e-2)


def test_shading_normals_are_the_file_s_own(shapes):
    """On a faceted sphere, E_direct follows the interpolated normals and not those of the facets."""
    light = shapes.sun()
    got = reference(ball(shapes, 0.5), shapes.view_of((0, 0, 4), (0, 0, 0), [light], (32, 32), 0.3))
    radial = got.position_world / np.linalg.norm(got.position_world, axis=-1, keepdims=True)
    inside = got.valid & (radial[..., 2] > 0.5)
    # On a facet 0.1 wide, the interpolated and the radial normal differ by less than 0.1²/8.
    np.testing.assert_allclose(got.normal_world[inside], radial[inside], atol=2e-3)
    expected = np.maximum(got.normal_world @ -light.direction_world, 0.0)[..., None] * light.intensity
    lit = inside & (expected[..., 0] > 0.1)
    np.testing.assert_allclose(got.direct_irradiance[lit], expected[lit], rtol=1e-4)


def texel_albedo(texture: Texture, row: int, column: int) -> np.ndarray:
    encoded = texture.texels_srgb[row, column] / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("wrap_u", ["repeat", "mirrored_repeat", "clamp_to_edge"])
@pytest.mark.parametrize("wrap_v", ["repeat", "mirrored_repeat", "clamp_to_edge"])
def test_texture_wraps_each_way_by_its_own_mode_with_v_down(shapes, wrap_u, wrap_v):
    """A texture of 4 × 2 texels on a quad with uv from −1.5 to 2.5."""
    texels = np.random.default_rng(1).integers(0, 256, (2, 4, 3), dtype=np.uint8)
    texture = Texture("checker", texels, wrap_u, wrap_v)
    quad = shapes.quad_mesh([0, 0, 0], [4, 0, 0], [0, 4, 0])
    # v increases downwards in the image, like the rows.
    uv = np.array([[-1.5, 2.5], [2.5, 2.5], [2.5, -1.5], [-1.5, -1.5]], np.float32)
    factor = np.array([0.9, 0.8, 0.7], np.float32)
    scene = shapes.scene_of([replace(quad, uv=uv)], [Material("painted", factor, 0)], [texture])
    # The quad covers 16 × 16 pixels, 4 for each unit of u and v, so the rows see v at odd eighths.
    view = shapes.view_of((2, 2, 2), (2, 2, 0), [shapes.sun()], (16, 16), np.pi / 2)
    got = reference(scene, view, max_samples=1)

    def wrapped(index, size, mode):
        if mode == "clamp_to_edge":
            return min(max(index, 0), size - 1)
        if mode == "repeat":
            return index % size
        index %= 2 * size
        return index if index < size else 2 * size - 1 - index

    for row in range(16):
        v = -1.5 + (row + 0.5) / 4.0
        for column in range(16):
            # Along u a texel is one pixel wide and the centres coincide. Along v it is two pixels high, and
            # the centre of a pixel is a quarter texel off, which blends two texels 3 to 1.
            i = wrapped(int(np.floor((-1.5 + (column + 0.5) / 4.0) * 4.0)), 4, wrap_u)
            place = v * 2.0 - 0.5
            weight = place - np.floor(place)
            rows = [wrapped(int(np.floor(place)) + k, 2, wrap_v) for k in range(2)]
            expected = factor * (
                texel_albedo(texture, rows[0], i) * (1 - weight) + texel_albedo(texture, rows[1], i) * weight
            )
            np.testing.assert_allclose(got.albedo[row, column], expected, atol=2e-5)


def test_vertex_colours_multiply_the_base_colour(shapes):
    quad = shapes.quad_mesh([-1, -1, 0], [2, 0, 0], [0, 2, 0])
    colors = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    scene = shapes.scene_of(
        [replace(quad, colors=colors)], [Material("tinted", np.array([0.5, 0.8, 1.0], np.float32))]
    )
    got = reference(scene, shapes.view_of((0, 0, 2), (0, 0, 0), [], (8, 8), 0.7), max_samples=1)
    expected = (got.position_world + 1.0) / 2.0 * [0.5, 0.8, 0.0]
    np.testing.assert_allclose(got.albedo, expected, atol=1e-5)
    assert got.irradiance.max() == 0.0


def test_misses_and_coordinates_without_a_fraction_read_inside_the_texture(shapes):
    """A read outside the bounds of a table would crash the process."""
    texture = Texture("one", np.full((8, 8, 3), 255, np.uint8))
    quad = shapes.quad_mesh([-1, -1, 0], [2, 0, 0], [0, 2, 0])
    for size in (1.0, 1e9, 3e38):
        stretched = replace(quad, uv=((quad.uv * 2.0 - 1.0) * np.float32(size)).astype(np.float32))
        scene = shapes.scene_of(
            [stretched], [Material("white", np.ones(3, np.float32), 0)], [texture], name=f"uv {size}"
        )
        # Three quarters of the rays miss.
        got = reference(scene, shapes.view_of((0, 0, 2), (0, 0, 0), [], (64, 64), 1.6), max_samples=4)
        assert 0.1 < got.valid.mean() < 0.5
        assert np.isfinite(got.albedo).all()
        if size == 1.0:
            np.testing.assert_allclose(got.albedo[got.valid], 1.0, rtol=1e-6)
