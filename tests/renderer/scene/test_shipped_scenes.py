"""The scenes in configs/scenes match their script, are valid and closed, and have the expected sizes."""

import math
import subprocess
import sys

import numpy as np
import pytest
from scene_paths import OWN_SCENES

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.transforms import transform_points

SCRIPT = OWN_SCENES[0].parent / "make_scenes.py"
# Name, longest edge of the bounds in metres, kind of light.
EXPECTED = {"cornell-box": (0.1007, "spot"), "gallery": (5.0, "spot"), "courtyard": (53.0, "directional")}


def test_the_script_makes_the_files_bit_for_bit(tmp_path):
    subprocess.run([sys.executable, SCRIPT, "--into", tmp_path], check=True, capture_output=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in OWN_SCENES)
    for path in OWN_SCENES:
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_size_light_camera_and_limits(path):
    scene = read_scene(path)
    longest, kind = EXPECTED[path.stem]
    assert float(np.ptp(scene.bounds(), axis=0).max()) == pytest.approx(longest, rel=0.02)
    assert [light.kind for light in scene.lights] == [kind] and len(scene.cameras) == 1
    assert scene.warnings == ()
    assert scene.triangle_count() < 3000 and path.stat().st_size < 100_000
    for material in scene.materials:
        assert material.base_color.min() >= 0.0 and material.base_color.max() <= 0.85


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_normals_point_the_way_the_triangles_face(path):
    for mesh in read_scene(path).meshes:
        a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
        facing = np.cross(b - a, c - a)
        assert np.linalg.norm(facing, axis=1).min() > 0.0
        corner_normals = mesh.normals[mesh.triangles].astype(np.float64)
        assert (np.einsum("tc,tkc->tk", facing, corner_normals) > 0.0).all(), mesh.name
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_solids_are_closed(path):
    """For a closed surface, ∮ n dA = 0, and the volume by the divergence theorem is positive.

    Flat walls and the Cornell blocks, which have no bottom face, are not closed and are skipped.
    """
    for mesh in read_scene(path).meshes:
        a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
        area_vectors = 0.5 * np.cross(b - a, c - a)
        if len(mesh.triangles) == 2 or "block" in mesh.name:
            continue
        assert np.abs(area_vectors.sum(axis=0)).max() < 1e-5 * np.linalg.norm(area_vectors, axis=1).sum()
        assert np.einsum("tc,tc->", a, area_vectors) / 3.0 > 0.0, f"{mesh.name} faces inwards"


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_no_two_faces_share_a_plane_where_they_overlap(path):
    """Overlapping coplanar triangles of different meshes cause z-fighting. Only axis-aligned are checked."""
    scene = read_scene(path)
    size = float(np.ptp(scene.bounds(), axis=0).max())
    faces = []
    for number, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        corners = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
        for axis in range(3):
            flat = np.ptp(corners[:, :, axis], axis=1) < 1e-7 * size
            others = [k for k in range(3) if k != axis]
            for triangle in corners[flat]:
                low, high = triangle[:, others].min(axis=0), triangle[:, others].max(axis=0)
                faces.append((number, axis, triangle[0, axis], low, high))
    for i, (number, axis, plane, low, high) in enumerate(faces):
        for other_number, other_axis, other_plane, other_low, other_high in faces[i + 1 :]:
            if number == other_number or axis != other_axis or abs(plane - other_plane) > 1e-6 * size:
                continue
            overlap = np.minimum(high, other_high) - np.maximum(low, other_low)
            assert overlap.min() < 1e-6 * size, (
                scene.instances[number].name,
                scene.instances[other_number].name,
            )


def test_the_cornell_box_is_the_published_one():
    """Cornell Box Data: corners in mm, a 25 mm film behind a 35 mm lens. Here all is scaled by 0.18."""
    scene = read_scene(next(path for path in OWN_SCENES if path.stem == "cornell-box"))
    millimetre = 0.18e-3
    assert scene.bounds() == pytest.approx(
        np.array([[0, 0, 0], [556.0, 548.8, 559.2]]) * millimetre, abs=1e-8
    )
    camera = scene.cameras[0]
    assert camera.position_world == pytest.approx(np.array([278, 273, -800]) * millimetre)
    assert camera.yfov == pytest.approx(2 * math.atan(12.5 / 35), abs=1e-8)
    assert camera.to_world[:3, 2] == pytest.approx([0, 0, -1])
    colors = {material.name: material.base_color for material in scene.materials}
    # The spectra converted by Mitsuba under an equal-energy light, divided by its white (1.2048, 0.9483,
    # 0.9087). Another illuminant and observer make a difference of a few hundredths.
    assert colors["white"] == pytest.approx([0.735, 0.737, 0.733], abs=0.02)
    assert colors["green"] == pytest.approx([0.0875, 0.3986, 0.0841], abs=0.03)
    assert colors["red"] == pytest.approx([0.4732, 0.0454, 0.0488], abs=0.03)
    heights = {
        instance.name: float(scene.meshes[instance.mesh].positions[:, 1].max())
        for instance in scene.instances
    }
    assert heights["short block"] == pytest.approx(165 * millimetre)
    assert heights["tall block"] == pytest.approx(330 * millimetre)


def test_the_gallery_has_a_texture_transform_and_vertex_colours():
    scene = read_scene(next(path for path in OWN_SCENES if path.stem == "gallery"))
    painting = next(mesh for mesh in scene.meshes if scene.materials[mesh.material].texture is not None)
    # The corners of the unit square, scaled by (2, 1) and offset by (0.25, 0).
    assert painting.uv[:, 0].min() == pytest.approx(0.25) and painting.uv[:, 0].max() == pytest.approx(2.25)
    ball = next(mesh for mesh in scene.meshes if mesh.name.startswith("ball"))
    assert np.ptp(ball.colors[:, 2]) > 0.2
