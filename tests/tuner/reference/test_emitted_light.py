"""Glowing surfaces and skies against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.polygon_irradiance import polygon_irradiance
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.environment import Environment, even_sky, solid_angles
from vpltune.renderer.scene.files.surface import turned
from vpltune.renderer.scene.scene import Light, Material, Texture, scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.reference import ReferenceView, noise_floor, reference_views

RADIANCE = np.array([3.0, 2.0, 1.0])


def reference(scene, view, **changes) -> ReferenceView:
    return reference_views(
        scene, (view,), **{"noise_target": 0.0, "max_samples": 64, "bounces": 1} | changes
    )[0]


def lamp(radiance=RADIANCE, reflectance=0.0, **changes) -> Material:
    """A material that glows."""
    return Material(
        "lamp", np.full(3, reflectance, np.float32), emission=tuple(map(float, radiance)), **changes
    )


def glowing_box(shapes, reflectance):
    """A closed box of 2 × 1 × 1.5 m whose walls glow inwards."""
    low, size = np.array([-1.0, 0.0, -0.75]), np.array([2.0, 1.0, 1.5])
    walls = []
    for axis in range(3):
        u, v = (np.eye(3)[(axis + k) % 3] * size for k in (1, 2))
        walls.append(shapes.quad_mesh(low, u, v, name=f"low {axis}"))
        walls.append(shapes.quad_mesh(low + np.eye(3)[axis] * size, v, u, name=f"high {axis}"))
    return shapes.scene_of(walls, [lamp(reflectance=reflectance)], name="box")


@pytest.mark.parametrize(("bounces", "reflectance"), [(1, 0.5), (2, 0.5), (None, 0.5), (None, 0.8)])
def test_a_furnace_gives_the_geometric_series(shapes, bounces, reflectance):
    """Where all walls glow evenly, E_direct = πL, and n bounces add πL·(ρ + … + ρⁿ), all πL·ρ/(1 − ρ)."""
    view = shapes.view_of((0.3, 0.6, 0.2), (-1, 0.3, 0), [])
    got = reference(glowing_box(shapes, reflectance), view, bounces=bounces, max_samples=2048)
    series = sum(reflectance**k for k in range(1, (bounces or 1000) + 1))
    assert got.valid.all()
    # With all bounces Russian roulette leaves some 0.2 % of noise, else there is far less.
    np.testing.assert_allclose(got.direct_irradiance.mean(axis=(0, 1)), np.pi * RADIANCE, rtol=1e-3)
    tolerance = 1e-3 if bounces else 8e-3
    np.testing.assert_allclose(got.irradiance.mean(axis=(0, 1)), series * np.pi * RADIANCE, rtol=tolerance)
    np.testing.assert_allclose(got.emission, np.broadcast_to(RADIANCE, got.albedo.shape), rtol=1e-6)


def floor_mesh(shapes, half=2.0, material=0):
    """A square about the origin that faces up."""
    return shapes.quad_mesh([-half, 0, -half], [0, 0, 2 * half], [2 * half, 0, 0], material, "floor")


@pytest.mark.parametrize("size", [(1, 1), (5, 7), (16, 32)])
def test_an_even_sky_over_open_ground_gives_pi_times_its_radiance(shapes, size):
    sky = Environment(np.broadcast_to(RADIANCE.astype(np.float32), (*size, 3)).copy())
    scene = replace(shapes.scene_of([floor_mesh(shapes)], [shapes.gray(0.5)]), environment=sky)
    got = reference(scene, shapes.view_of((0.1, 3, 2), (0, 0, -0.5), [], yfov=1.3))
    assert 0.2 < got.valid.mean() < 0.9
    np.testing.assert_allclose(got.direct_irradiance[got.valid].mean(axis=0), np.pi * RADIANCE, rtol=5e-3)
    assert got.irradiance.max() == got.direct_irradiance[~got.valid].max() == 0.0
    # Beside the ground the camera sees the sky.
    np.testing.assert_allclose(
        got.emission[~got.valid], np.broadcast_to(RADIANCE, got.albedo[~got.valid].shape)
    )
    assert got.emission[got.valid].max() == 0.0


def test_every_texel_of_the_sky_shines_from_its_own_direction(shapes):
    """E = Σ L·∫ max(0, cos θ) dω over the texels, on planes that face six ways."""
    rng = np.random.default_rng(4)
    height, width, fine = 4, 6, 32
    sky = Environment((rng.random((height, width, 3)) ** 4 * 5.0).astype(np.float32))
    polar = np.pi * (np.arange(height * fine) + 0.5) / (height * fine)
    azimuth = 2.0 * np.pi * (np.arange(width * fine) + 0.5) / (width * fine)
    # From −Z towards +X, and from +Y down.
    directions = np.stack(
        [
            np.outer(np.sin(polar), np.sin(azimuth)),
            np.broadcast_to(np.cos(polar)[:, None], (len(polar), len(azimuth))),
            -np.outer(np.sin(polar), np.cos(azimuth)),
        ],
        axis=-1,
    )
    radiance = np.repeat(np.repeat(sky.radiance, fine, axis=0), fine, axis=1)
    angles = solid_angles(height * fine, width * fine)[:, None, None]
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = side * np.eye(3)[axis]
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3] * side
            scene = shapes.scene_of([shapes.quad_mesh(-u - v, 2 * u, 2 * v)], [shapes.gray(0.5)])
            view = shapes.view_of(3 * normal, (0, 0, 0), [], (8, 8), 0.4)
            got = reference(replace(scene, environment=sky), view, max_samples=1024)
            cosine = np.maximum(directions @ normal, 0.0)[..., None]
            expected = (radiance * cosine * angles).sum(axis=(0, 1))
            assert got.valid.all()
            np.testing.assert_allclose(got.direct_irradiance.mean(axis=(0, 1)), expected, rtol=3e-3)


def test_beside_a_wall_the_sky_is_cut_off(shapes):
    """At a distance d from an endless black wall of height h, E = πL·(1 + d/√(d² + h²))/2."""
    wall = shapes.quad_mesh([0, 0, -500], [0, 0, 1000], [0, 1, 0], 1, "wall")
    scene = shapes.scene_of([floor_mesh(shapes), wall], [shapes.gray(0.5), shapes.gray(0.0)])
    scene = replace(scene, environment=even_sky(tuple(RADIANCE)))
    got = reference(scene, shapes.view_of((1.0, 3, 0.01), (1.0, 0, 0), [], (16, 4), 0.15), max_samples=1024)
    distance = got.position_world[..., 0]
    assert got.valid.all() and distance.min() > 0.0
    expected = np.pi * RADIANCE * ((1.0 + distance / np.hypot(distance, 1.0)) / 2.0)[..., None]
    np.testing.assert_allclose(got.direct_irradiance, expected, rtol=0.02)
    np.testing.assert_allclose(got.direct_irradiance.mean(), expected.mean(), rtol=2e-3)


def test_the_polygon_formula_is_howell_s():
    """Howell et al., configuration B-3: a corner of a rectangle of a × b straight over the point at c.

    F = (A/√(1+A²)·atan(B/√(1+A²)) + B/√(1+B²)·atan(A/√(1+B²)))/2π with A = a/c, B = b/c.
    """
    corners = np.array([[0, 1, 0], [0.7, 1, 0], [0.7, 1, 1.3], [0, 1, 1.3]])
    a, b = 0.7, 1.3
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    factor = (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)
    assert polygon_irradiance(corners, np.zeros(3), np.array([0, 1, 0])) == pytest.approx(np.pi * factor)


def panel_scene(shapes, material, corner=(-0.5, 1, -0.3), edge_u=(1, 0, 0), edge_v=(0, 0, 0.6)):
    """A panel of which the front faces down, over a floor of reflectance 0.5."""
    panel = shapes.quad_mesh(corner, edge_u, edge_v, 1, "panel")
    return shapes.scene_of([floor_mesh(shapes), panel], [shapes.gray(0.5), material])


@pytest.mark.parametrize(
    ("corner", "edge_u", "edge_v"),
    [
        ((-0.5, 1, -0.3), (1, 0, 0), (0, 0, 0.6)),  # over the floor
        ((-0.5, 0.001, -0.3), (0, 0.5, 0), (0, 0, 0.6)),  # beside it, almost touching: the spiky case
    ],
)
def test_a_panel_lights_the_floor_by_its_form_factor(shapes, corner, edge_u, edge_v):
    """E = L·π·F for the direct light of a rectangle, and nothing else, since nothing else reflects it."""
    scene = panel_scene(shapes, lamp(), corner, edge_u, edge_v)
    view = shapes.view_of((0.9, 0.8, 0.9), (0.1, 0, 0.05), [], (12, 12), 0.5)
    got = reference(scene, view, max_samples=1024)
    corners = np.array([corner, np.add(corner, edge_u), np.add(np.add(corner, edge_u), edge_v)])
    corners = np.concatenate([corners, [np.add(corner, edge_v)]])
    on_floor = got.valid & (got.albedo[..., 0] > 0.0)
    in_front = on_floor & ((got.position_world[..., 0] > -0.49) | (edge_v[2] == 0))
    assert in_front.sum() > 100
    expected = polygon_irradiance(corners, got.position_world[in_front], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(got.direct_irradiance[in_front], expected[:, None] * RADIANCE, rtol=0.03)
    assert got.direct_irradiance[in_front].mean() == pytest.approx(expected.mean() * 2.0, rel=1e-3)
    # Light that the floor sends to the black panel does not return.
    assert got.irradiance[in_front].max() == 0.0


def mirrored(scene):
    """The panel reflected at x = 0, where it lies again, by a node of negative determinant; and turned, as a
    reader turns it, so that its front stays in front."""
    moved = replace(scene.instances[1], to_world=np.diag([-1.0, 1.0, 1.0, 1.0]))
    meshes = [turned(mesh) if i == moved.mesh else mesh for i, mesh in enumerate(scene.meshes)]
    return replace(scene, meshes=tuple(meshes), instances=(scene.instances[0], moved))


@pytest.mark.parametrize("reflect", [False, True])
def test_the_front_alone_glows_unless_both_sides_do(shapes, reflect):
    """The front is the side from where triangles run counter-clockwise in the world."""
    view = shapes.view_of((0.9, 0.6, 0.9), (0.1, 0, 0.05), [], (8, 8), 0.5)
    seen_from_below = shapes.view_of((0.1, 0.1, 0.1), (0.0, 1, 0), [], (4, 4), 0.2)
    away_from_floor = {"corner": (-0.5, 1, -0.3), "edge_u": (0, 0, 0.6), "edge_v": (1, 0, 0)}
    levels = []
    for both, away in ((False, {}), (True, {}), (True, away_from_floor), (False, away_from_floor)):
        scene = panel_scene(shapes, lamp(emits_both_ways=both), **away)
        scene = mirrored(scene) if reflect else scene
        got = reference(scene, view, max_samples=256)
        levels.append(got.direct_irradiance[got.albedo[..., 0] > 0.0].mean())
        seen = reference(scene, seen_from_below, max_samples=1).emission
        np.testing.assert_allclose(seen.mean(axis=(0, 1)), RADIANCE if both or not away else 0.0, rtol=1e-6)
    front, both, both_turned, turned_away = levels
    assert front == pytest.approx(both, rel=0.01) and front == pytest.approx(both_turned, rel=0.01)
    assert turned_away == 0.0 < front


def test_a_texture_is_a_factor_of_the_emission(shapes):
    """A panel whose texture is black on one half shines like the other half alone."""
    texels = np.zeros((2, 64, 3), np.uint8)
    texels[:, :32] = [255, 188, 0]
    linear = np.array([1.0, ((188 / 255 + 0.055) / 1.055) ** 2.4, 0.0])
    view = shapes.view_of((0.9, 0.6, 0.9), (0.1, 0, 0.05), [], (8, 8), 0.5)
    scene = replace(
        panel_scene(shapes, lamp(emission_texture=0)), textures=(Texture("half", texels, "clamp_to_edge"),)
    )
    half = panel_scene(shapes, lamp(RADIANCE * linear), edge_u=(0.5, 0, 0))
    got, expected = (reference(each, view, max_samples=1024).direct_irradiance for each in (scene, half))
    # The filter blurs the edge by a texel, evenly to both sides.
    np.testing.assert_allclose(got.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=5e-3)


@pytest.mark.parametrize("both_lights", [False, True])
def test_a_half_transparent_panel_glows_by_half_and_the_sky_shines_through(shapes, both_lights):
    panel = panel_scene(shapes, lamp())
    veil = panel_scene(shapes, lamp(alpha_mode="blend", opacity=0.5))
    view = shapes.view_of((0.9, 0.6, 0.9), (0.1, 0, 0.05), [], (8, 8), 0.5)
    sky = even_sky((1.0, 2.0, 3.0)) if both_lights else None
    made = [replace(each, environment=sky) for each in (panel, veil)]
    made.append(replace(panel, instances=panel.instances[:1], environment=sky))
    full, half, none = (
        reference(each, view, max_samples=1024).direct_irradiance.mean(axis=(0, 1)) for each in made
    )
    np.testing.assert_allclose(half, (full + none) / 2.0, rtol=5e-3)


def test_punctual_light_and_glow_add_up(shapes):
    light = Light("point", np.array([0.5, 0.4, 0.3]), position_world=np.array([0.6, 0.7, 0.1]))
    view = shapes.box_room_view((16, 12), (light,))
    room = shapes.box_room()
    glowing = replace(
        room,
        materials=(
            room.materials[0],
            replace(room.materials[1], emission=(0.3, 0.1, 0.05)),
            room.materials[2],
        ),
        environment=even_sky((0.1, 0.1, 0.2)),
    )
    arguments = {"bounces": 3, "max_samples": 512}
    both = reference(glowing, view, **arguments)
    parts = [reference(room, view, **arguments), reference(glowing, replace(view, lights=()), **arguments)]
    for name in ("direct_irradiance", "irradiance"):
        added = sum(getattr(each, name) for each in parts).mean(axis=(0, 1))
        np.testing.assert_allclose(getattr(both, name).mean(axis=(0, 1)), added, rtol=5e-3)
    np.testing.assert_array_equal(both.emission, parts[1].emission)
    assert parts[0].emission is None and parts[0].direct_noise_floor == 0.0


def glowing_room(shapes):
    """The room with a panel under its ceiling and a sky of few texels in front."""
    room = shapes.box_room()
    panel = shapes.quad_mesh([-0.3, 1.98, -0.3], [0.6, 0, 0], [0, 0, 0.6], 3, "panel")
    sky = Environment(np.random.default_rng(2).random((4, 8, 3)).astype(np.float32))
    added = shapes.scene_of([*room.meshes, panel], [*room.materials, lamp(RADIANCE * 4.0)])
    placed = (*room.instances, added.instances[-1])
    return replace(added, instances=placed, environment=sky)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_changes_nothing(shapes, factor):
    scene, view = glowing_room(shapes), shapes.box_room_view((16, 12))
    base = reference(scene, view)
    other = reference(scaled(scene, factor), scaled_view(view, factor))
    for name in ("irradiance_a", "irradiance_b", "direct_irradiance"):
        error = np.abs(getattr(other, name) - getattr(base, name)) / base.irradiance.mean()
        assert np.mean(error) < 1e-3, name
    np.testing.assert_allclose(other.emission, base.emission)


def test_sampling_goes_on_until_direct_light_has_little_noise_too(shapes):
    scene, view = glowing_room(shapes), shapes.box_room_view((16, 12), [])
    truth = reference(scene, view, seed=1, max_samples=4096)
    got = reference(scene, view, noise_target=1e-3, max_samples=4096)
    assert max(noise_floor(got), got.direct_noise_floor) <= 1e-3 and got.samples < 4096
    measured, foretold = [], []
    for seed in range(2, 8):
        short = reference(scene, view, seed=seed, max_samples=16)
        valid = short.valid
        right = truth.direct_irradiance[valid]
        error = (short.direct_irradiance[valid] - right) ** 2 / (right**2 + 0.01 * right.mean() ** 2)
        measured.append(error.mean())
        foretold.append(short.direct_noise_floor)
    # Six seeds of 190 pixels; each scatters by some 10 %.
    assert np.mean(measured) == pytest.approx(np.mean(foretold), rel=0.25)


@pytest.mark.parametrize(
    ("emission", "sky", "message"),
    [
        ((-1.0, 0.0, 0.0), 1.0, "mesh 'panel': emission must be finite and at least 0"),
        ((np.inf, 0.0, 0.0), 1.0, "mesh 'panel': emission must be finite"),
        ((1.0, 0.0, 0.0), np.nan, "environment: radiance must be finite"),
        ((1.0, 0.0, 0.0), -1.0, "environment: radiance must be finite and at least 0"),
    ],
)
def test_radiance_that_is_no_light_is_refused(shapes, emission, sky, message):
    scene = replace(panel_scene(shapes, lamp(emission)), environment=even_sky((sky, 0.0, 0.0)))
    with pytest.raises(InputError, match=message):
        reference(scene, shapes.view_of((0.9, 0.6, 0.9), (0, 0, 0), []))
