"""`vpltune init`: the sidecar holds what would be chosen without it, and is not overwritten unasked."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from built_scenes import colored_room

from vpltune.cli.program import run
from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar

TRIANGLES = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 0\nf 1 4 3 2\nf 1 2 5\n"
GALLERY = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "gallery.glb"


def check_written(scene_path):
    scene = read_scene(scene_path)
    camera, lights, _ = resolve_camera_and_lights(scene, scene_path, None, None)
    assert run(["init", str(scene_path)]) == 0
    own = read_sidecar(scene_path.with_suffix(".vpltune.toml"))
    own_camera, own_lights = own.camera, own.lights
    # Fifteen digits are written; the matrix of a look_at is another way to the same.
    np.testing.assert_allclose(own_camera.to_world, camera.to_world, atol=1e-6)
    assert [light.kind for light in own_lights] == [light.kind for light in lights]
    for own, light in zip(own_lights, lights, strict=True):
        np.testing.assert_allclose(own.intensity, light.intensity, rtol=1e-12)
        if light.kind != "directional":
            np.testing.assert_allclose(own.position_world, light.position_world, rtol=1e-12)


def test_an_automatic_choice_is_written(tmp_path, capfd):
    path = tmp_path / "room.obj"
    path.write_text(TRIANGLES)
    check_written(path)
    assert "chosen automatically" in capfd.readouterr().err


def test_the_scenes_own_camera_and_light_are_written(tmp_path):
    shutil.copy(GALLERY, tmp_path / "gallery.glb")
    check_written(tmp_path / "gallery.glb")


def test_a_sidecar_is_replaced_only_when_asked(tmp_path, capfd):
    path = tmp_path / "room.obj"
    path.write_text(TRIANGLES)
    sidecar = tmp_path / "room.vpltune.toml"
    sidecar.write_text("mine")
    assert run(["init", str(path)]) == 2
    assert capfd.readouterr().err.endswith("room.vpltune.toml: exists already; --force replaces it\n")
    assert sidecar.read_text() == "mine"
    assert run(["init", str(path), "--force"]) == 0
    assert sidecar.read_text().startswith("#")


def test_a_roll_is_told(tmp_path, capfd):
    """A sidecar's camera is upright."""
    scene = read_scene(GALLERY)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]]
    rolled = replace(scene.cameras[0], to_world=scene.cameras[0].to_world @ turn)
    write_glb(tmp_path / "rolled.glb", replace(scene, cameras=(rolled,)))
    assert run(["init", str(tmp_path / "rolled.glb")]) == 0
    assert "rolled about its view axis" in capfd.readouterr().err


def test_a_pipe_is_no_sidecar(tmp_path, capfd):
    """It would be waited for without end."""
    path = tmp_path / "room.obj"
    path.write_text(TRIANGLES)
    os.mkfifo(tmp_path / "room.vpltune.toml")
    assert run(["render", str(path), "-o", str(tmp_path / "x.png"), "--size", "32x24"]) == 2
    assert "room.vpltune.toml: must be a file" in capfd.readouterr().err


def test_a_sidecar_that_is_replaced_keeps_its_sky(tmp_path):
    write_glb(tmp_path / "room.glb", replace(colored_room(), lights=(), cameras=()))
    sidecar = tmp_path / "room.vpltune.toml"
    sidecar.write_text("[sky]\nradiance = 2\n")
    assert run(["init", str(tmp_path / "room.glb"), "--force"]) == 0
    kept = read_sidecar(sidecar)
    assert kept.sky is not None
    assert kept.sky.radiance == (2.0, 2.0, 2.0)
    # No light is made up beside a sky.
    assert kept.lights == ()
    sidecar.write_text("[sky")
    assert run(["init", str(tmp_path / "room.glb"), "--force"]) == 0
    assert len(read_sidecar(sidecar).lights or ()) == 1
