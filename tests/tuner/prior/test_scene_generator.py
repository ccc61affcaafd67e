"""Generated scenes are valid, reproducible, and varied."""

import numpy as np
import pytest

from vpltune.renderer.scene.placement.free_space import free_space
from vpltune.tuner.prior.scene_generator import KINDS, generated_name, generated_scene, room_and_hall
from vpltune.tuner.reference.content_key import scene_digest

NUMBERS = range(2 * len(KINDS))


@pytest.mark.parametrize("number", NUMBERS)
def test_a_scene_is_whole(number):
    scene = generated_scene(number)
    assert scene.name == generated_name(number)
    assert len(scene.cameras) == 1 and 1 <= len(scene.lights) <= 2
    for mesh in scene.meshes:
        assert np.isfinite(mesh.positions).all()
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
        assert 0 <= mesh.material < len(scene.materials)
        corners = mesh.positions[mesh.triangles].astype(np.float64)
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # The winding and the normal of each triangle agree.
        assert (np.einsum("tk,tk->t", facing, mesh.normals[mesh.triangles[:, 0]]) > 0.0).all()
    for material in scene.materials:
        assert ((material.base_color >= 0.02) & (material.base_color <= 0.9)).all()


@pytest.mark.parametrize("number", NUMBERS)
def test_camera_and_lamps_stand_inside_and_free(number):
    """Camera and lights are within the bounds and not inside a box."""
    scene = generated_scene(number)
    low, high = scene.bounds()
    space = free_space(scene)
    points = [scene.cameras[0].position_world]
    points += [light.position_world for light in scene.lights if light.kind != "directional"]
    for point in points:
        assert ((point > low) & (point < high)).all()
        assert space.clearance_at(space.to_voxels(point)[None])[0] > 0.0


def test_the_same_number_is_the_same_scene():
    assert scene_digest(generated_scene(3)) == scene_digest(generated_scene(3))
    assert scene_digest(generated_scene(3)) != scene_digest(generated_scene(8))
    assert scene_digest(generated_scene(3)) != scene_digest(generated_scene(3, seed=1))


def test_they_differ():
    """They differ in kind, in light, and in scale by a factor of at least 100."""
    scenes = [generated_scene(number) for number in range(20)]
    assert {scene.name.split("-")[0] for scene in scenes} == set(KINDS)
    assert {light.kind for scene in scenes for light in scene.lights} == {"spot", "point", "directional"}
    sizes = [np.linalg.norm(np.diff(scene.bounds(), axis=0)) for scene in scenes]
    assert max(sizes) > 100.0 * min(sizes)


def test_the_room_and_the_hall_are_one_space():
    """A straight path through the doorway is free."""
    space = free_space(room_and_hall())
    way = np.array([[0.0, 1.5, z] for z in np.linspace(3.0, -6.0, 40)])
    assert (space.clearance_at(space.to_voxels(way)) > 0.0).all()
