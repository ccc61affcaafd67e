"""Where an environment comes from, what sidecars say of it, and that no light is made up beside it."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.image_file import write_exr
from vpltune.renderer.scene.environment import even_sky
from vpltune.renderer.scene.placement import resolve_camera_and_lights, views_for_scene, with_environment
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.placement.own_light import has_own_light
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.placement.sidecar_file import sidecar_text
from vpltune.renderer.scene.scene import Camera, Scene, Texture


def room() -> Scene:
    """A room without lights and cameras."""
    return replace(colored_room(), lights=(), cameras=())


def glowing_room(emission=(1.0, 1.0, 1.0), texels=None) -> Scene:
    scene = room()
    first = replace(scene.materials[scene.meshes[0].material], emission=emission)
    textures = scene.textures
    if texels is not None:
        first = replace(first, emission_texture=len(textures))
        textures = (*textures, Texture("glow", texels))
    materials = list(scene.materials)
    materials[scene.meshes[0].material] = first
    return replace(scene, materials=tuple(materials), textures=textures)


def sidecar(folder, text):
    (folder / "room.vpltune.toml").write_text(text, encoding="utf-8")
    return folder / "room.glb"


def test_flags_go_before_the_sidecar_and_this_before_the_scene(tmp_path):
    scene = replace(room(), environment=even_sky((1.0, 1.0, 1.0)))
    path = tmp_path / "room.glb"
    assert with_environment(scene, path) is scene
    assert with_environment(scene, None) is scene
    path = sidecar(tmp_path, "[sky]\nradiance = [1, 2, 3]\n")
    np.testing.assert_array_equal(with_environment(scene, path).environment.radiance, [[[1.0, 2.0, 3.0]]])
    given = GivenSky((5.0, 5.0, 5.0))
    np.testing.assert_array_equal(with_environment(scene, path, given).environment.radiance, 5.0)
    np.testing.assert_array_equal(with_environment(scene, None, given).environment.radiance, 5.0)
    assert with_environment(scene, path, GivenSky((0.0, 0.0, 0.0))).environment is None
    path = sidecar(tmp_path, "[sky]\nradiance = 0\n")
    assert with_environment(scene, path).environment is None


def test_a_map_beside_the_scene_is_scaled_and_turned(tmp_path):
    radiance = np.random.default_rng(1).uniform(0.0, 2.0, (4, 8, 3)).astype(np.float32)
    write_exr(tmp_path / "sky.exr", radiance)
    path = sidecar(tmp_path, '[sky]\nenvironment = "sky.exr"\nscale = 2\nrotation = 90\n')
    baked = with_environment(room(), path).environment.radiance
    # A quarter turn about +Y takes −Z to −X, from the azimuth 0 to −90°.
    np.testing.assert_allclose(baked, np.roll(2.0 * radiance, -2, axis=1), rtol=1e-6)


def test_a_map_named_by_the_user_may_be_anywhere(tmp_path):
    write_exr(tmp_path / "sky.exr", np.ones((2, 4, 3), np.float32))
    (tmp_path / "scenes").mkdir()
    path = sidecar(tmp_path / "scenes", '[sky]\nenvironment = "../sky.exr"\n')
    with pytest.raises(
        InputError, match=r"\[sky\]: must stay inside the scene's folder, got '\.\./sky\.exr'"
    ):
        with_environment(room(), path)
    scene = with_environment(room(), path, GivenSky(file=str(tmp_path / "sky.exr")))
    np.testing.assert_array_equal(scene.environment.radiance, 1.0)


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
@pytest.mark.parametrize("content", [None, b"", b"no image"])
def test_maps_that_cannot_be_read_are_refused_by_name(tmp_path, suffix, content):
    file = tmp_path / f"sky.{suffix}"
    if content is not None:
        file.write_bytes(content)
    path = sidecar(tmp_path, f'[sky]\nenvironment = "sky.{suffix}"\n')
    with pytest.raises(InputError, match=rf"room\.vpltune\.toml: \[sky\]: 'sky\.{suffix}'") as error:
        with_environment(room(), path)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"^--environment: "):
        with_environment(room(), path, GivenSky(file=str(file)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 1e30])
def test_radiance_of_a_map_is_bounded(tmp_path, value):
    radiance = np.ones((2, 4, 3), np.float32)
    radiance[1, 2, 0] = value
    write_exr(tmp_path / "sky.exr", radiance)
    with pytest.raises(InputError, match="radiance must be"):
        with_environment(room(), sidecar(tmp_path, '[sky]\nenvironment = "sky.exr"\n'))


@pytest.mark.parametrize(
    "sky", [GivenSky((0.5, 0.25, 1e-3)), GivenSky(file='a "sky" ü\\🌤.exr', scale=2.5, rotation_degrees=-37.5)]
)
def test_a_written_sky_reads_back(tmp_path, sky):
    path = tmp_path / "room.vpltune.toml"
    path.write_text(sidecar_text(None, None, sky), encoding="utf-8")
    read = read_sidecar(path)
    assert read.sky == sky
    assert (read.camera, read.lights) == (None, None)
    path.write_text(sidecar_text(Camera(np.eye(4), 1.0), (), sky), encoding="utf-8")
    again = read_sidecar(path)
    assert (again.sky, again.lights) == (sky, ())
    assert again.camera is not None


@pytest.mark.parametrize(
    ("scene", "shines"),
    [
        (room(), False),
        (glowing_room(), True),
        (glowing_room((0.0, 0.0, 1e-9)), True),
        (glowing_room(texels=np.zeros((2, 2, 3), np.uint8)), False),
        (glowing_room(texels=np.ones((2, 2, 3), np.uint8)), True),
        (replace(room(), environment=even_sky((0.0, 0.0, 1.0))), True),
        (replace(room(), environment=even_sky((0.0, 0.0, 0.0))), False),
    ],
)
def test_no_light_is_made_up_where_something_shines(tmp_path, scene, shines):
    assert has_own_light(scene) == shines
    camera, lights, notes = resolve_camera_and_lights(scene, tmp_path / "room.glb", None, None)
    assert (len(lights) == 0) == shines
    assert any("light chosen automatically" in note for note in notes) != shines
    assert camera.yfov > 0.0


def test_views_without_lights_differ_by_their_cameras(tmp_path):
    scene = glowing_room()
    camera, lights, _ = resolve_camera_and_lights(scene, tmp_path / "room.glb", None, None)
    views = views_for_scene(scene, camera, lights, fitted=2, validation=1, held_out=1, size=(8, 6), seed=0)
    assert all(view.lights == () for view in views)
    places = {tuple(view.camera.position_world.round(6)) for view in views}
    assert len(places) == len(views)


def test_a_sidecar_may_ask_for_no_lights(tmp_path):
    path = sidecar(tmp_path, "light = []\n")
    _, lights, notes = resolve_camera_and_lights(room(), path, None, None)
    assert lights == ()
    assert "lights taken from room.vpltune.toml" in notes
