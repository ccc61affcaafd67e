"""A scene written as .glb and read back is the same scene."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, quad

from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera, Instance, Light, Material, Scene, Texture
from vpltune.renderer.scene.scene_animation import Animation
from vpltune.renderer.scene.transforms import look_at


def _rich_scene() -> Scene:
    random = np.random.default_rng(5)
    plain = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), name="plain")
    coloured = dataclasses.replace(
        quad((0, 0, 1), (2, 0, 0), (0, 3, 0), material=1, name="coloured"),
        uv=random.uniform(-2.0, 2.0, (4, 2)).astype(np.float32),
        colors=random.uniform(0.0, 1.0, (4, 3)).astype(np.float32),
    )
    turned = np.eye(4)
    turned[:3, :3] = random.uniform(-1.0, 1.0, (3, 3))
    turned[:3, 3] = 0.1, -7.0, 1.0 / 3.0
    texels = random.integers(0, 256, (5, 3, 3)).astype(np.uint8)
    return Scene(
        name="rich",
        meshes=(plain, coloured, replace(coloured, name="holed", material=2)),
        instances=(
            Instance("a", 0, np.eye(4)),
            Instance("b", 1, turned),
            Instance("c", 0, turned @ turned),
            Instance("d", 2, turned),
        ),
        materials=(
            Material("one", np.float32([1.0 / 3.0, 0.0, 1.0])),
            Material("two", np.float32([0.1, 0.2, 0.3]), 0, emission=(0.5, 0.25, 0.0), emits_both_ways=True),
            Material("holes", np.float32([0.1, 0.2, 0.3]), 1, "mask", 0.75, 0.25),
        ),
        textures=(
            Texture("noise", texels, "mirrored_repeat", "clamp_to_edge"),
            Texture("holes", texels, opacity=random.integers(0, 256, (5, 3)).astype(np.uint8)),
        ),
        lights=(
            Light(
                "spot",
                np.array([3.0, 0.0, 1e-3]),
                np.array([1.0, 2.0, 3.0]),
                np.array([0.6, -0.8, 0.0]),
                0.1,
                0.9,
                range=2.5,
            ),
            Light("spot", np.ones(3), direction_world=np.array([0.0, -1.0, 0.0]), outer_cone=np.pi / 2),
            Light("point", np.array([0.0, 5e4, 1.0]), np.array([-1.0, 0.0, 0.0]), name="bulb"),
            Light("directional", np.array([9.0, 8.0, 7.0]), direction_world=np.array([0.0, 0.0, 1.0])),
        ),
        cameras=(Camera(look_at(np.array([3.0, 1.0, 2.0]), np.zeros(3)), 0.7),),
    )


@pytest.mark.parametrize("scene", [_rich_scene(), colored_room()], ids=lambda scene: scene.name)
def test_everything_comes_back(tmp_path, scene):
    write_glb(tmp_path / "written.glb", scene, notes=("a note",))
    read = read_scene(tmp_path / "written.glb")
    assert read.warnings == ()
    for mine, other in zip(scene.meshes, read.meshes, strict=True):
        for name in ("positions", "uv", "colors", "triangles"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(other, name), err_msg=name)
        # Made unit length anew, in double precision.
        np.testing.assert_allclose(mine.normals, other.normals, atol=1.2e-7)
        assert mine.material == other.material
    for mine, other in zip(scene.instances, read.instances, strict=True):
        np.testing.assert_array_equal(mine.to_world, other.to_world)
        assert (mine.name, mine.mesh) == (other.name, other.mesh)
    for mine, other in zip(scene.materials, read.materials, strict=True):
        np.testing.assert_array_equal(mine.base_color, other.base_color)
        assert (mine.texture, mine.emission_texture) == (other.texture, other.emission_texture)
        np.testing.assert_allclose(mine.emission, other.emission, rtol=1e-15)
        assert not mine.glows or mine.emits_both_ways == other.emits_both_ways
        assert (mine.alpha_mode, mine.opacity) == (other.alpha_mode, other.opacity)
        assert mine.is_opaque or mine.alpha_cutoff == other.alpha_cutoff
    for mine, other in zip(scene.textures, read.textures, strict=True):
        np.testing.assert_array_equal(mine.texels_srgb, other.texels_srgb)
        assert (mine.opacity is None) == (other.opacity is None)
        if mine.opacity is not None:
            np.testing.assert_array_equal(mine.opacity, other.opacity)
        assert (mine.wrap_u, mine.wrap_v) == (other.wrap_u, other.wrap_v)
    for mine, other in zip(scene.cameras, read.cameras, strict=True):
        np.testing.assert_allclose(mine.to_world, other.to_world, atol=1e-14)
        assert mine.yfov == other.yfov
    assert [light.kind for light in read.lights] == [light.kind for light in scene.lights]
    for mine, other in zip(scene.lights, read.lights, strict=True):
        np.testing.assert_allclose(mine.intensity, other.intensity, rtol=1e-15)
        if mine.kind != "directional":
            np.testing.assert_array_equal(mine.position_world, other.position_world)
            assert mine.range == other.range
        if mine.kind != "point":
            np.testing.assert_allclose(mine.direction_world, other.direction_world, atol=1e-15)
        if mine.kind == "spot":
            assert (mine.inner_cone, mine.outer_cone) == (other.inner_cone, other.outer_cone)


def test_strong_textured_emission_comes_back(tmp_path):
    texels = np.random.default_rng(2).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    sheet = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])
    glow = Material("glow", np.zeros(3, np.float32), emission=(300.0, 20.0, 1e-3), emission_texture=0)
    scene = Scene(
        "glow",
        (replace(sheet, uv=np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])),),
        (Instance("plain", 0, np.eye(4)), Instance("mirrored", 0, mirror)),
        (glow,),
        (Texture("pattern", texels),),
    )
    write_glb(tmp_path / "written.glb", scene)
    read = read_scene(tmp_path / "written.glb")
    (material,) = read.materials
    np.testing.assert_allclose(material.emission, glow.emission, rtol=1e-15)
    assert (material.emission_texture, material.emits_both_ways) == (0, False)
    np.testing.assert_array_equal(read.textures[0].texels_srgb, texels)
    for instance, wanted in zip(read.instances, scene.instances, strict=True):
        # The front, which alone shines, is wound as it was, although glTF's is clockwise in a mirror.
        mesh = read.meshes[instance.mesh]
        np.testing.assert_array_equal(mesh.positions, scene.meshes[0].positions)
        np.testing.assert_array_equal(mesh.triangles, scene.meshes[wanted.mesh].triangles)
        np.testing.assert_allclose(mesh.normals, scene.meshes[0].normals, atol=1e-7)


def test_trimesh_reads_the_same_areas(tmp_path):
    import trimesh

    scene = _rich_scene()
    write_glb(tmp_path / "written.glb", scene)
    mine = 0.0
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corners = (mesh.positions.astype(np.float64) @ instance.to_world[:3, :3].T)[mesh.triangles]
        mine += (
            0.5
            * np.linalg.norm(
                np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
            ).sum()
        )
    assert trimesh.load_scene(tmp_path / "written.glb").to_mesh().area == pytest.approx(mine, rel=1e-5)


def test_a_moving_scene_is_not_written_still(tmp_path):
    scene = dataclasses.replace(colored_room(), animation=Animation.__new__(Animation))
    with pytest.raises(ValueError, match="has an animation"):
        write_glb(tmp_path / "written.glb", scene)
    assert not list(tmp_path.iterdir())
