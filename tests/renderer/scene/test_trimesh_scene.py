"""Scenes from trimesh are those that our readers read from the same file, and trimesh need not be there."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from scene_paths import OWN_SCENES

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.transforms import look_at, transform_points
from vpltune.renderer.scene.trimesh_scene import scene_from_trimesh

SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def trimesh():
    return pytest.importorskip("trimesh")


def shaded_area(scene: Scene) -> np.ndarray:
    """∫ albedo dA without textures, [3], which neither the order of meshes nor that of corners changes."""
    total = np.zeros(3)
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        points = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
        area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1) / 2
        shade = mesh.colors[mesh.triangles].mean(axis=1) * scene.materials[mesh.material].base_color
        total += (area[:, None] * shade).sum(axis=0)
    return total


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_a_file_is_the_same_by_way_of_trimesh(trimesh, path):
    """Bounds to 1e-6, and ∫ albedo dA to 0.5 %: trimesh keeps factors of materials as bytes."""
    ours, theirs = read_scene(path), scene_from_trimesh(trimesh.load_scene(path))
    assert theirs.triangle_count() == ours.triangle_count()
    np.testing.assert_allclose(theirs.bounds(), ours.bounds(), atol=1e-6)
    np.testing.assert_allclose(shaded_area(theirs), shaded_area(ours), rtol=5e-3)
    assert len(theirs.textures) == len(ours.textures)
    for own, other in zip(ours.textures, theirs.textures, strict=True):
        np.testing.assert_array_equal(own.texels_srgb, other.texels_srgb)


def test_a_texture_is_as_in_the_file_that_trimesh_writes(trimesh, tmp_path):
    """Texels and texture coordinates, whose v points up in trimesh and down in glTF; to float32."""
    texels = np.random.default_rng(5).integers(0, 256, (4, 8, 3), dtype=np.uint8)
    uv = np.array([[0.0, 0.0], [0.7, 0.1], [0.9, 1.0], [0.2, 0.6]])
    visual = trimesh.visual.TextureVisuals(uv, image=Image.fromarray(texels))
    mesh = trimesh.Trimesh(SQUARE, HALVES, visual=visual)
    mesh.export(tmp_path / "square.glb")
    corners = []
    for scene in (read_scene(tmp_path / "square.glb"), scene_from_trimesh(mesh)):
        np.testing.assert_array_equal(scene.textures[0].texels_srgb, texels)
        both = np.concatenate([scene.meshes[0].positions, scene.meshes[0].uv], axis=1)
        corners.append(np.unique(both.round(5), axis=0))
    np.testing.assert_allclose(corners[0], corners[1], atol=1e-5)
    white = scene_from_trimesh(mesh).materials[0].base_color
    np.testing.assert_array_equal(white, np.ones(3))


def test_a_mesh_placed_twice_is_one_mesh(trimesh):
    box = trimesh.creation.box()
    source = trimesh.Scene()
    source.add_geometry(box, geom_name="box", node_name="left")
    source.graph.update("right", matrix=trimesh.transformations.translation_matrix([3, 0, 0]), geometry="box")
    scene = scene_from_trimesh(source)
    assert (len(scene.meshes), len(scene.instances)) == (1, 2)
    np.testing.assert_allclose(scene.bounds(), [[-0.5, -0.5, -0.5], [3.5, 0.5, 0.5]])


def test_colours_of_vertices_and_faces_are_srgb(trimesh):
    linear = linear_from_srgb(np.float32([200 / 255, 100 / 255, 50 / 255]))
    for kind in ("vertex_colors", "face_colors"):
        count = {"vertex_colors": 4, "face_colors": 2}[kind]
        colors = np.tile(np.uint8([200, 100, 50, 255]), (count, 1))
        mesh = scene_from_trimesh(trimesh.Trimesh(SQUARE, HALVES, **{kind: colors})).meshes[0]
        np.testing.assert_allclose(mesh.colors, np.broadcast_to(linear, mesh.colors.shape), rtol=1e-6)


def test_emissive_factors_are_emission(trimesh):
    mesh = trimesh.creation.box()
    material = trimesh.visual.material.PBRMaterial(emissiveFactor=[1.0, 0.5, 0.0], doubleSided=True)
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)), material=material)
    (made,) = scene_from_trimesh(mesh).materials
    assert (made.emission, made.emits_both_ways) == ((1.0, 0.5, 0.0), True)


def test_shading_is_flat_unless_asked(trimesh):
    box = trimesh.creation.box()
    flat, smooth = (scene_from_trimesh(box, smooth=smooth).meshes[0] for smooth in (False, True))
    assert len(flat.positions) == 36
    assert len(smooth.positions) == 8
    assert np.sort(np.abs(flat.normals), axis=1)[:, 2].min() > 0.999
    assert np.abs(smooth.normals).max() < 0.9


def test_a_camera_that_was_set_is_taken_and_lights_are_given(trimesh):
    pose = look_at([0, 0, 4], [0, 0, 0])
    source = trimesh.Scene(
        trimesh.creation.box(),
        camera=trimesh.scene.Camera(name="eye", resolution=(64, 48), fov=(60, 45)),
        camera_transform=pose,
    )
    scene = scene_from_trimesh(source, lights=[Light("point", 1.0, [0, 2, 0])])
    (camera,) = scene.cameras
    assert camera.yfov == pytest.approx(np.radians(45.0))
    np.testing.assert_allclose(camera.to_world, pose, atol=1e-12)
    assert len(scene.lights) == 1
    own = Camera(look_at([1, 1, 4], [0, 0, 0]), 1.0)
    assert scene_from_trimesh(source, cameras=[own]).cameras[0].yfov == 1.0
    assert scene_from_trimesh(trimesh.Scene(trimesh.creation.box())).cameras == ()


def test_point_clouds_are_left_out_with_a_warning(trimesh):
    source = trimesh.Scene({"dust": trimesh.PointCloud(SQUARE), "box": trimesh.creation.box()})
    scene = scene_from_trimesh(source)
    assert len(scene.instances) == 1
    assert scene.warnings == ("geometry 'dust' is a PointCloud, no mesh; it is ignored",)


def test_whatever_has_vertices_and_faces_will_do():
    """trimesh is known by what its objects have: it is not imported."""
    visual = SimpleNamespace(kind=None)
    mesh = SimpleNamespace(vertices=SQUARE, faces=HALVES, visual=visual)
    assert scene_from_trimesh(mesh).triangle_count() == 2


def test_what_is_wrong_is_one_line():
    with pytest.raises(InputError, match="source: must be a trimesh.Scene or trimesh.Trimesh, got int"):
        scene_from_trimesh(3)
    mesh = SimpleNamespace(vertices=SQUARE, faces=HALVES + 1, visual=SimpleNamespace(kind=None))
    with pytest.raises(InputError, match="geometry 'trimesh': triangles: must be from 0 to below the 4"):
        scene_from_trimesh(mesh)
    empty = SimpleNamespace(vertices=SQUARE, faces=[[0, 1, 1]], visual=SimpleNamespace(kind=None))
    with pytest.raises(InputError, match="the scene has no triangles"):
        scene_from_trimesh(empty)
