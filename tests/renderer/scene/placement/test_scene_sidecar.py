"""The sidecar beside a scene, and the precedence of flags, sidecar, scene file and automatic choice."""

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from scene_paths import OWN_SCENES

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights, sidecar_file
from vpltune.renderer.scene.placement.free_space import free_space
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.placement.sidecar_file import near_miss, sidecar_path, sidecar_text
from vpltune.renderer.scene.placement.sight import lit_fraction, seen_by
from vpltune.renderer.scene.scene import Light, Scene

CAMERA = "[camera]\neye = [3.6, 2.7, -1.7]\nlook_at = [-2, 1.7, 0.9]\nyfov_degrees = 65\n"
SPOT = """[[light]]
type = "spot"
position = [0.0, 2.0, 0.0]
look_at = [0.0, 0.0, 2.0]
intensity = 10
inner_cone_degrees = 30
outer_cone_degrees = 60
"""


def written(tmp_path, text):
    path = tmp_path / "room.vpltune.toml"
    path.write_text(text, encoding="utf-8")
    return path


def with_lights(scene: Scene, *lights: Light) -> Scene:
    return Scene(scene.name, scene.meshes, scene.instances, scene.materials, scene.textures, lights)


def test_the_sidecar_lies_beside_the_scene(tmp_path):
    assert sidecar_path(tmp_path / "room.glb") == tmp_path / "room.vpltune.toml"


def test_camera_and_spot(tmp_path):
    sidecar = read_sidecar(written(tmp_path, CAMERA + SPOT))
    camera, lights = sidecar.camera, sidecar.lights
    assert camera.position_world.tolist() == [3.6, 2.7, -1.7]
    ahead = np.array([-2, 1.7, 0.9]) - np.array([3.6, 2.7, -1.7])
    assert -camera.to_world[:3, 2] == pytest.approx(ahead / np.linalg.norm(ahead))
    assert camera.yfov == pytest.approx(math.radians(65))
    (light,) = lights
    assert light.kind == "spot" and light.intensity.tolist() == [10, 10, 10]
    assert light.direction_world == pytest.approx([0, -math.sqrt(0.5), math.sqrt(0.5)])
    assert math.degrees(light.inner_cone) == pytest.approx(30)
    assert math.degrees(light.outer_cone) == pytest.approx(60)


def test_point_and_directional(tmp_path):
    text = '[[light]]\ntype = "point"\nposition = [1, 2, 3]\nintensity = [1, 2, 3]\n'
    text += '[[light]]\ntype = "directional"\ndirection = [0, -3, 0]\nintensity = 5.5\n'
    sidecar = read_sidecar(written(tmp_path, text))
    camera, (point, sun) = sidecar.camera, sidecar.lights
    assert camera is None
    assert point.position_world.tolist() == [1, 2, 3] and point.intensity.tolist() == [1, 2, 3]
    assert sun.direction_world.tolist() == [0, -1, 0] and sun.intensity.tolist() == [5.5] * 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[camera]\neye = [0, 0, 0]\nlook_at = [0, 0, 1]\nfov = 3\n", r"\[camera\]: unknown key 'fov'"),
        ("[camra]\n", "unknown key 'camra'"),
        ("[camera\n", "not TOML"),
        ("a=" + "[" * 100_000, "not a sidecar .nested too deep"),
        ("a=" + "[" * 400 + "]" * 400, "unknown key 'a'|nested too deep"),
        ("#" * (1 << 20) + "#", "must have at most 1,048,576 bytes"),
        ("camera = 3\n", "must be a table, got int"),
        ("[camera]\neye = [0, 0, 0]\n", "key 'look_at' is missing"),
        (
            "[camera]\neye = [0, 0, nan]\nlook_at = [0, 0, 1]\n",
            r"must be 3 finite numbers, got \[0, 0, nan\]",
        ),
        ("[camera]\neye = [0, 0, 1e300]\nlook_at = [0, 0, 1]\n", "'eye' must be 3 finite numbers"),
        ("[camera]\neye = [0, 0]\nlook_at = [0, 0, 1]\n", "'eye' must be 3 finite numbers"),
        ("[camera]\neye = [0, 0, true]\nlook_at = [0, 0, 1]\n", "'eye' must be 3 finite numbers"),
        ("[camera]\neye = [0, 0, 1]\nlook_at = [0, 0, 1]\n", "'look_at' must differ from 'eye'"),
        (CAMERA.replace("65", "180"), "'yfov_degrees' must lie between 0 and 180, got 180"),
        (SPOT.replace('"spot"', '"sopt"'), "'type' must be 'spot', 'point' or 'directional', got 'sopt'"),
        (SPOT.replace("[[light]]", "[light]"), r"lights must be written as \[\[light\]\] tables"),
        (SPOT.replace("intensity = 10", "intensity = -1"), "'intensity' must not be negative"),
        (SPOT.replace("intensity = 10", "intensity = inf"), "'intensity' must be 1 or 3 finite numbers"),
        (SPOT.replace("intensity = 10", "intensity = [10]"), r"'intensity' must be 1 or 3 .*got \[10\]"),
        (SPOT + "range = [1]\n", r"'range' must be 1 finite number, got \[1\]"),
        (SPOT.replace("= 30", "= [30]"), r"'inner_cone_degrees' must be 1 finite number, got \[30\]"),
        (CAMERA.replace("65", "[65]"), r"'yfov_degrees' must be 1 finite number, got \[65\]"),
        (SPOT.replace("intensity = 10", "intensity = 1e31"), r"'intensity' .*at most 1e\+30 each"),
        (SPOT.replace("= 30", "= 70"), r"cone angles must satisfy 0 ≤ inner ≤ outer ≤ 90 degrees"),
        (SPOT + "direction = [0, -1, 0]\n", "must have either 'direction' or 'look_at', got both"),
        (SPOT.replace("[0.0, 0.0, 2.0]", "[0.0, 2.0, 0.0]"), "direction must not be zero"),
        (SPOT.replace("spot", "point"), "unknown key 'look_at'"),
        ("[sky]\n", r"\[sky\]: must have either 'radiance' or 'environment'"),
        ('[sky]\nradiance = 1\nenvironment = "a.exr"\n', "must have either 'radiance' or 'environment'"),
        ("[sky]\nradiance = 1\nscale = 2\n", "unknown key 'scale'"),
        ("[sky]\nradiance = [1, -1, 1]\n", "'radiance' must not be negative"),
        ("[sky]\nradiance = nan\n", "'radiance' must be 1 or 3 finite numbers"),
        ("[sky]\nradiance = [1]\n", r"'radiance' must be 1 or 3 finite numbers, got \[1\]"),
        ('[sky]\nenvironment = "a.exr"\nscale = [1]\n', r"'scale' must be 1 finite number, got \[1\]"),
        ("[sky]\nradiance = 1e30\n", r"'radiance' .*at most 1e\+18 each"),
        ('[sky]\nenvironment = "a.png"\n', r"must be a file that ends in \.exr or \.hdr, got 'a\.png'"),
        ("[sky]\nenvironment = 3\n", r"must be a file that ends in \.exr or \.hdr, got 3"),
        ('[sky]\nenvironment = "a.exr"\nscale = -1\n', "'scale' must not be negative"),
        ('[sky]\nenvironment = "a.exr"\nturn = 1\n', "unknown key 'turn'"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as error:
        read_sidecar(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_a_sidecar_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "room.vpltune.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_sidecar(path)


def test_a_byte_order_mark_is_passed_over(tmp_path):
    path = tmp_path / "room.vpltune.toml"
    path.write_text("\ufeff" + CAMERA, encoding="utf-8")
    assert read_sidecar(path).camera is not None


def test_flags_go_before_sidecar_before_file_before_automatic(tmp_path):
    scene, view = colored_room(), room_view()
    scene_path = tmp_path / "room.glb"
    camera, lights, notes = resolve_camera_and_lights(scene, scene_path, None, None)
    assert len(notes) == 2 and all("chosen automatically" in note for note in notes)

    in_file = with_lights(scene, *view.lights)
    _, lights, notes = resolve_camera_and_lights(in_file, scene_path, view.camera, None)
    assert lights is in_file.lights and notes == ()

    written(tmp_path, CAMERA + SPOT)
    camera, lights, notes = resolve_camera_and_lights(in_file, scene_path, None, None)
    assert camera.position_world.tolist() == [3.6, 2.7, -1.7] and lights[0].intensity[0] == 10
    assert notes == ("camera and lights taken from room.vpltune.toml",)

    camera, lights, notes = resolve_camera_and_lights(in_file, scene_path, view.camera, view.lights)
    assert camera is view.camera and lights is view.lights and notes == ()


def test_the_files_own_camera_and_light_are_kept():
    for path in OWN_SCENES:
        scene = read_scene(path)
        camera, lights, notes = resolve_camera_and_lights(scene, path, None, None)
        assert camera is scene.cameras[0] and lights is scene.lights and notes == ()


def test_a_file_with_a_light_only_gets_a_camera_that_sees_what_is_lit():
    path = next(path for path in OWN_SCENES if path.stem == "gallery")
    full = read_scene(path)
    # Behind the partition, where the automatic camera would not look by itself.
    lamp = Light("point", np.ones(3), np.array([4.6, 2.0, 1.0]))
    camera, lights, notes = resolve_camera_and_lights(with_lights(full, lamp), path, None, None)
    space = free_space(full)
    assert lights == (lamp,)
    assert lit_fraction(space, seen_by(space, camera), lights) > 0.1
    assert any("the given light reaches" in note for note in notes)


def test_a_light_of_the_file_that_lights_nothing_in_sight_is_replaced_and_that_is_said(tmp_path):
    view = room_view()
    above = Light("spot", np.ones(3), np.array([0.0, 50.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    scene = with_lights(colored_room(), above)
    _, lights, notes = resolve_camera_and_lights(scene, tmp_path / "room.glb", view.camera, None)
    assert lights[0] is not above
    assert "the scene's light reaches nothing the camera sees" in notes[0]
    assert "light chosen automatically" in notes[1]


def test_a_light_of_the_file_that_ends_before_all_in_sight_is_kept_and_that_is_said(tmp_path):
    """Without its range, the same light reaches most of the room."""
    view = room_view("point")
    light = dataclasses.replace(view.lights[0], range=0.1)
    scene = with_lights(colored_room(), light)
    _, lights, notes = resolve_camera_and_lights(scene, tmp_path / "room.glb", view.camera, None)
    assert lights == (light,)
    assert "within range, the scene's light reaches nothing the camera sees" in notes


def test_a_scene_without_triangles_is_refused(tmp_path):
    with pytest.raises(InputError, match="must have at least one triangle, got none"):
        resolve_camera_and_lights(Scene("empty", (), (), ()), tmp_path / "empty.glb", None, None)


@pytest.mark.parametrize(
    "name",
    [
        "Room.vpltune.toml",
        "room.vpltune.tml",
        "room.glb.vpltune.toml",
        "room.vpltune",
        "room.vpltune.toml.txt",
        "room.vpl.toml",
        "room.toml",
        "rom.vpltune.toml",
        "room.VPLtune.toml",
    ],
)
def test_a_near_miss_of_the_sidecars_name_is_said(tmp_path, name):
    scene, view = colored_room(), room_view()
    (tmp_path / "room.glb").touch()
    (tmp_path / name).write_text(CAMERA)
    said = f"{name} is not read: the scene's sidecar would be room.vpltune.toml"
    assert said in resolve_camera_and_lights(scene, tmp_path / "room.glb", None, None)[2]
    assert resolve_camera_and_lights(scene, tmp_path / "room.glb", view.camera, view.lights)[2] == ()
    written(tmp_path, CAMERA + SPOT)
    assert said not in resolve_camera_and_lights(scene, tmp_path / "room.glb", None, None)[2]


@pytest.mark.parametrize(
    "name", ["rooms.vpltune.toml", "room.vpltune.json", "room.vpltune.glb", "pyproject.toml", "tuned.json"]
)
def test_other_files_beside_a_scene_are_no_near_misses(tmp_path, name):
    """rooms.vpltune.toml is the sidecar of rooms.obj."""
    for file in ("room.glb", "rooms.obj", name):
        (tmp_path / file).touch()
    assert near_miss(tmp_path / "room.glb") is None


def test_the_work_for_near_misses_is_linear_in_the_scenes_of_a_folder(tmp_path, monkeypatch):
    """The folder is listed once, and each scene is compared with a bounded number of names."""
    count = 1_000
    for i in range(count):
        (tmp_path / f"scene {i:04}.glb").touch()
        (tmp_path / f"SCENE {i:04}.vpltune.toml").touch()
        (tmp_path / f"other {i:04}.vpltune.tml").touch()
    listings, comparisons = [], []
    list_folder, compare = Path.iterdir, sidecar_file._alike
    monkeypatch.setattr(Path, "iterdir", lambda path: listings.append(path) or list_folder(path))
    monkeypatch.setattr(sidecar_file, "_alike", lambda *both: comparisons.append(both) or compare(*both))
    for i in range(count):
        assert near_miss(tmp_path / f"scene {i:04}.glb") == f"SCENE {i:04}.vpltune.toml"
        assert near_miss(tmp_path / f"third {i:04}.glb") is None
    assert listings == [tmp_path]
    # A suffix for each file, and a hundred names for each scene that has no other.
    assert len(comparisons) <= 2 * count + 100 * count


def test_a_folder_that_changed_is_listed_again(tmp_path):
    (tmp_path / "room.glb").touch()
    assert near_miss(tmp_path / "room.glb") is None
    (tmp_path / "Room.vpltune.toml").touch()
    # Folders keep the time of a change to some milliseconds.
    os.utime(tmp_path, ns=(0, 0))
    assert near_miss(tmp_path / "room.glb") == "Room.vpltune.toml"


def test_what_is_written_reads_back(tmp_path):
    sidecar = read_sidecar(
        written(
            tmp_path,
            CAMERA + SPOT + '[[light]]\ntype = "point"\nposition = [1, 2, 3]\nintensity = 4\nrange = 2.5\n',
        )
    )
    camera, lights = sidecar.camera, sidecar.lights
    path = tmp_path / "again.vpltune.toml"
    path.write_text(sidecar_text(camera, lights), encoding="utf-8")
    again, lights_again = read_sidecar(path).camera, read_sidecar(path).lights
    # Seven digits of the eye and the target, which stand a few units apart.
    np.testing.assert_allclose(again.to_world, camera.to_world, atol=1e-5)
    assert again.yfov == pytest.approx(camera.yfov, rel=1e-6)
    for one, other in zip(lights, lights_again, strict=True):
        assert (one.kind, one.range) == (other.kind, other.range)
        np.testing.assert_allclose(one.position_world, other.position_world, atol=1e-5)
        np.testing.assert_allclose(one.direction_world, other.direction_world, atol=1e-6)
        np.testing.assert_allclose(one.intensity, other.intensity, rtol=1e-6)
        assert (one.inner_cone, one.outer_cone) == pytest.approx((other.inner_cone, other.outer_cone), 1e-6)
