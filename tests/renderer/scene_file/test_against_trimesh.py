"""Real scenes against an independent reader: trimesh finds the same surface in the same place."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from scene_paths import OUTSIDE_SCENES, OWN_SCENES, outside_scene

from renderer.scene import transform_points
from renderer.scene_file import read_scene


def area_and_bounds_by_trimesh(path: Path) -> tuple[float, np.ndarray]:
    import trimesh

    # Of materials it cannot read it warns; shapes are all that is asked here.
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        loaded = trimesh.load_scene(path, skip_materials=True)
        meshes = [mesh for mesh in loaded.dump() if isinstance(mesh, trimesh.Trimesh)]
    area = sum(float(mesh.area) for mesh in meshes)
    corners = np.concatenate([mesh.triangles.reshape(-1, 3) for mesh in meshes])
    return area, np.stack([corners.min(axis=0), corners.max(axis=0)])


def area_and_bounds(path: Path) -> tuple[float, np.ndarray]:
    scene = read_scene(path)
    area, lows, highs = 0.0, [], []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corners = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
        area += np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).sum()
        lows.append(corners.min(axis=(0, 1)))
        highs.append(corners.max(axis=(0, 1)))
    return float(area / 2.0), np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])


def compare(path: Path) -> None:
    """Tolerance 1e-4: trimesh composes transforms and stores vertices in its own precision."""
    area, bounds = area_and_bounds(path)
    other_area, other_bounds = area_and_bounds_by_trimesh(path)
    assert area == pytest.approx(other_area, rel=1e-4)
    reach = np.linalg.norm(bounds[1] - bounds[0])
    np.testing.assert_allclose(bounds, other_bounds, atol=1e-4 * reach)


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_our_scenes(path):
    compare(path)


@pytest.mark.parametrize("name", OUTSIDE_SCENES)
def test_scenes_of_others(scenes_folder, name):
    compare(outside_scene(scenes_folder, name))
