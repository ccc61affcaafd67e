"""Automatic cameras and lights: free space compared with closed forms, then properties of the choices."""

import math

import numpy as np
import pytest
from built_scenes import colored_room, quad, scene_of
from scene_paths import OUTSIDE_SCENES, OWN_SCENES, outside_scene

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import default_camera, default_light, rasterised_surfaces
from vpltune.renderer.scene.placement.free_places import is_room
from vpltune.renderer.scene.placement.free_space import free_space, march_rays, marched, sphere_directions
from vpltune.renderer.scene.placement.sight import cone_directions, light_hits, lit, lit_fraction, seen_by
from vpltune.renderer.scene.scene import Camera, Light, scaled, scaled_camera, scaled_light
from vpltune.renderer.scene.transforms import look_at


def box_mesh(low, high, material=0):
    """A closed box of six quads that face outwards."""
    low, extent = np.array(low, float), np.array(high, float) - np.array(low, float)
    x, y, z = np.diag(extent)
    return [
        quad(low, z, y, material),
        quad(low + x, y, z, material),
        quad(low, x, z, material),
        quad(low + y, z, x, material),
        quad(low, y, x, material),
        quad(low + z, x, y, material),
    ]


def own(name: str):
    return read_scene(next(path for path in OWN_SCENES if path.stem == name))


def test_every_voxel_that_a_triangle_crosses_is_occupied():
    """At least 95 % of random points on slanted, thin and large triangles are in occupied voxels.

    Samples are 0.3 voxels apart, so a voxel can be missed if a triangle only clips its corner.
    """
    random = np.random.default_rng(1)
    meshes = [quad([0, 0, 0], [10, 1.3, 0.2], [0.3, 7, 3]), quad([0, 5, 0], [9, 0.1, 8], [0.01, 0.02, 0.0])]
    space = free_space(scene_of(meshes, [(0.5, 0.5, 0.5)]))
    for mesh in meshes:
        a, b, c = mesh.positions[mesh.triangles[0]].astype(float)
        s, t = random.random((2, 20000))
        across = (1 - t)[:, None] * (b - a) + t[:, None] * (c - a)
        points = space.to_voxels(a + np.sqrt(s)[:, None] * across)
        index = tuple(np.floor(points).astype(int).T)
        assert space.occupied[index].mean() > 0.95
        # A missed voxel touches an occupied one, at worst at an edge.
        assert space.clearance[index].max() < 1.5


def test_a_scene_of_more_triangles_than_samples_keeps_its_grid(monkeypatch):
    """More triangles than the budget has samples for: the grid gets coarser, but not without end.

    A voxel as large as the scene would leave no place for a camera, and put the light far off.
    """
    side = 40
    at = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    tiles = [quad([x, 0, z], [0, 0, 1], [1, 0, 0]) for x, z in at]
    monkeypatch.setattr(rasterised_surfaces, "SAMPLE_BUDGET", 4 * 2 * side**2 - 1)
    scene = scene_of([*tiles, *box_mesh([10, 1, 10], [20, 9, 20])], [(0.5, 0.5, 0.5)])
    space = free_space(scene)
    assert space.voxel_world < side / 8
    camera, _ = default_camera(scene)
    light, _ = default_light(scene, camera)
    for place in (camera.position_world, light.position_world):
        assert np.linalg.norm(place - 0.5 * side) < 4 * side


def test_voxel_areas_add_up_to_the_surface():
    """The voxel areas sum to the surface area up to rounding, since a triangle's shares sum to 1."""
    space = free_space(scene_of(box_mesh([0, 0, 0], [2, 3, 4]), [(0.5, 0.5, 0.5)]))
    assert space.area.sum() * space.voxel_world**2 == pytest.approx(52.0, rel=1e-5)


def test_clearance_is_the_distance_to_the_nearest_occupied_voxel():
    space = free_space(colored_room())
    occupied = np.argwhere(space.occupied)
    for index in np.argwhere(~space.occupied)[::9973]:
        nearest = np.sqrt(((occupied - index) ** 2).sum(axis=1).min())
        assert space.clearance[tuple(index)] == pytest.approx(nearest, rel=1e-6)


def test_marched_distances_in_a_box_are_the_closed_form():
    """The distance from the centre of a cube of edge 2 to its walls is 1/max|ω|."""
    space = free_space(scene_of(box_mesh([-1, -1, -1], [1, 1, 1]), [(0.5, 0.5, 0.5)]))
    directions = sphere_directions(500)
    hits = marched(space, space.to_voxels(np.zeros((1, 3))), directions)
    assert hits.hit.all()
    expected = 1.0 / np.abs(directions).max(axis=1) / space.voxel_world
    # A wall's voxel begins at most one voxel before the wall, which is up to √3 voxels along a slanted ray.
    assert np.abs(hits.distance[0] - expected).max() < math.sqrt(3.0)


def test_rays_enter_the_grid_from_outside_and_leave_it():
    space = free_space(scene_of(box_mesh([-1, -1, -1], [1, 1, 1]), [(0.5, 0.5, 0.5)]))
    origins = space.to_voxels(np.array([[5.0, 0, 0], [5.0, 0, 0], [5.0, 3.0, 0]]))
    hits = march_rays(space, origins, np.array([[-1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0]]))
    assert hits.hit.tolist() == [True, False, False]
    assert hits.distance[0] * space.voxel_world == pytest.approx(4.0, abs=1.5 * space.voxel_world)
    assert np.isinf(hits.distance[1:]).all() and (hits.voxel[1:] == -1).all()


def test_cone_directions_fill_their_cone_evenly():
    """The mean cosine of a uniform cap is (1 + cos θ)/2. The lattice has it to within 1/count."""
    axis = np.array([0.6, 0.0, 0.8])
    cosine = cone_directions(axis, math.radians(40.0), 2000) @ axis
    assert cosine.min() >= math.cos(math.radians(40.0)) - 1e-9
    assert cosine.mean() == pytest.approx(0.5 * (1 + math.cos(math.radians(40.0))), abs=1e-3)


@pytest.mark.parametrize("kind", ["spot", "point", "directional"])
def test_lit_points_are_those_in_sight_of_the_light(kind):
    """A slab over the left half of a floor puts it in shadow."""
    floor = quad([-4, 0, -4], [0, 0, 8], [8, 0, 0])
    scene = scene_of([floor, *box_mesh([-4, 2, -4], [0, 2.3, 4])], [(0.5, 0.5, 0.5)])
    space = free_space(scene)
    down = np.array([0.0, -1.0, 0.0])
    light = Light(kind, np.ones(3), np.array([0.0, 5.0, 0.0]), down, 0.2, math.radians(30.0))
    x = np.array([-2.0, 2.0, 3.7])
    reached = lit(space, light, space.to_voxels(np.stack([x, 0 * x, 0 * x], axis=1)))
    # 3.7 is outside the spot's cone, whose radius on the floor is 5·tan 30° = 2.9.
    assert reached.tolist() == [False, True, kind != "spot"]


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("cornell-box", 100.0),
        ("gallery", 0.01),
        pytest.param("gallery", 7.3, marks=pytest.mark.slow),
        ("courtyard", 0.1),
    ],
)
def test_choices_do_not_depend_on_scale(name, factor):
    """A scaled scene gets the scaled camera and light, up to the rounding of 10⁻⁵ voxels in placement."""
    scene = own(name)
    camera, _ = default_camera(scene)
    light, _ = default_light(scene, camera)
    camera_scaled, _ = default_camera(scaled(scene, factor))
    light_scaled, _ = default_light(scaled(scene, factor), camera_scaled)
    expected_camera, expected_light = scaled_camera(camera, factor), scaled_light(light, factor)
    size = factor * float(np.ptp(scene.bounds(), axis=0).max())
    assert np.abs(camera_scaled.position_world - expected_camera.position_world).max() < 1e-6 * size
    assert np.abs(camera_scaled.to_world[:3, :3] - expected_camera.to_world[:3, :3]).max() < 1e-6
    assert np.abs(light_scaled.position_world - expected_light.position_world).max() < 1e-6 * size
    assert np.abs(light_scaled.direction_world - expected_light.direction_world).max() < 1e-6
    assert light_scaled.intensity == pytest.approx(expected_light.intensity, rel=1e-5)


def test_choices_are_the_same_every_time():
    first, second = own("gallery"), own("gallery")
    camera_a, camera_b = default_camera(first)[0], default_camera(second)[0]
    light_a, light_b = default_light(first, camera_a)[0], default_light(second, camera_b)[0]
    assert np.array_equal(camera_a.to_world, camera_b.to_world)
    assert np.array_equal(light_a.position_world, light_b.position_world)
    assert np.array_equal(light_a.intensity, light_b.intensity)


def solid_room():
    """A closed room of 6 × 3 × 6 with a closed solid block of 2 × 3 × 2 in the middle."""
    walls = box_mesh([-3, 0, -3], [3, 3, 3])
    for wall in walls:
        wall.triangles[:] = wall.triangles[:, ::-1].copy()
    return scene_of([*walls, *box_mesh([-1, -0.1, -1], [1, 3.1, 1])], [(0.7, 0.7, 0.7)])


def test_camera_and_light_stand_in_the_room_and_not_in_the_solid():
    scene = solid_room()
    assert is_room(free_space(scene))
    camera, note = default_camera(scene)
    light, _ = default_light(scene, camera)
    assert "inside" in note
    for x, y, z in (camera.position_world, light.position_world):
        assert abs(x) < 3 and 0 < y < 3 and abs(z) < 3
        assert max(abs(x), abs(z)) > 1


def test_an_object_is_seen_whole_from_outside():
    scene = scene_of(box_mesh([-1, 0, -1], [1, 2, 1]), [(0.7, 0.7, 0.7)])
    camera, note = default_camera(scene)
    assert "outside" in note
    low, high = scene.bounds()
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    local = (corners - camera.position_world) @ camera.to_world[:3, :3]
    tangent = local[:, :2] / -local[:, 2:]
    assert (local[:, 2] < 0).all()
    assert np.abs(tangent[:, 1]).max() < math.tan(camera.yfov / 2)
    assert np.abs(tangent[:, 0]).max() < math.tan(camera.yfov / 2) * 4 / 3
    light, _ = default_light(scene, camera)
    assert light_hits(free_space(scene), light).hit.mean() > 0.4


def test_a_box_with_one_side_open_is_looked_into():
    camera, note = default_camera(own("cornell-box"))
    assert "open side" in note
    # The published box is open towards −z, and the published camera looks along +z.
    assert -camera.to_world[2, 2] == pytest.approx(1.0)


def test_the_spot_gives_pi_watts_per_square_metre_at_its_mean_square_distance():
    scene = solid_room()
    camera, _ = default_camera(scene)
    light, _ = default_light(scene, camera)
    space = free_space(scene)
    hits = light_hits(space, light)
    square = (hits.distance[hits.hit] ** 2).mean() * space.voxel_world**2
    assert light.intensity == pytest.approx(np.full(3, math.pi * square), rel=1e-9)


def test_degenerate_scenes_still_get_a_camera_and_a_light():
    """A single flat quad has no depth, no inside and no volume."""
    scene = scene_of([quad([0, 0, 0], [1, 0, 0], [0, 1, 0])], [(0.5, 0.5, 0.5)])
    camera, _ = default_camera(scene)
    light, _ = default_light(scene, camera)
    assert np.isfinite(camera.to_world).all() and np.isfinite(light.intensity).all()


def test_a_camera_in_the_void_still_gets_a_light():
    scene = own("gallery")
    away = Camera(look_at(np.array([50.0, 50.0, 50.0]), np.array([60.0, 50.0, 50.0])), 1.0)
    light, _ = default_light(scene, away)
    assert np.isfinite(light.position_world).all() and (light.intensity > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE_SCENES)
def test_scenes_of_others_get_a_camera_that_sees_and_a_light_that_lights(scenes_folder, name):
    scene = read_scene(outside_scene(scenes_folder, name))
    camera, _ = default_camera(scene)
    light, _ = default_light(scene, camera)
    space = free_space(scene)
    sight = seen_by(space, camera)
    # An image of an object has background, one of a room hardly any.
    assert sight.hit_fraction > (0.7 if is_room(space) else 0.12)
    assert 0.2 < lit_fraction(space, sight, (light,)) < 0.97
    # 0.32 was seen: around a chess board there is nothing to hit.
    assert light_hits(space, light).hit.mean() > 0.3
