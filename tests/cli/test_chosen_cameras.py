"""`--camera NAME` and `fit --views FILE`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from quick_fit import QUICK_FIT

from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import named_camera, named_cameras
from vpltune.renderer.scene.views import read_views, write_views

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A shipped room with a second camera, half a metre behind the first one."""
    folder = tmp_path_factory.mktemp("room")
    scene = read_scene(REPOSITORY / "configs" / "scenes" / "gallery.glb")
    (first,) = scene.cameras
    behind = first.to_world.copy()
    behind[:3, 3] -= 0.5 * behind[:3, 2]
    cameras = (replace(first, name="door"), replace(first, to_world=behind, name="near"))
    write_glb(folder / "room.glb", replace(scene, cameras=cameras))
    write_config(folder / "small.json", TunedConfig(QUICK_FIT))
    write_config(folder / "few.json", TunedConfig(ArtistParameters(vpl_count=32)))
    return folder


def test_cameras_have_names_and_numbers(room):
    scene = read_scene(room / "room.glb")
    assert [camera.name for camera in scene.cameras] == ["door", "near"]
    assert named_camera(scene, "near") is named_camera(scene, "2") is scene.cameras[1]
    assert named_camera(scene, "0000000000002") is scene.cameras[1]
    assert named_cameras(scene, "all") == scene.cameras


@pytest.mark.parametrize("name", ["0", "3", "0000000015", "1" + "0" * 5000, "-1", "²", "١", ""])
def test_a_number_that_no_camera_has_is_refused(room, name):
    scene = read_scene(room / "room.glb")
    for select in (named_camera, named_cameras):
        with pytest.raises(InputError, match="--camera: must be .*one of 'door', 'near', got"):
            select(scene, name)
    with pytest.raises(InputError, match="--camera: the scene has no cameras; leave --camera out, got"):
        named_cameras(replace(scene, cameras=()), name)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--camera", "far"], "--camera: must be one of 'door', 'near', got 'far'"),
        (["--camera", "3"], "got '3'"),
        (["--camera", "all"], "--camera: an image needs one camera, got all, which is for fit"),
        (["--camera", "near", "--eye", "0,1,2", "--look-at", "0,0,0"], "leave out --eye, --look-at, --yfov"),
    ],
)
def test_what_is_no_camera_is_refused(room, tmp_path, capfd, given, message):
    assert run(["render", str(room / "room.glb"), "-o", str(tmp_path / "x.png"), *given]) == 2
    assert message in capfd.readouterr().err


def test_an_image_is_of_the_named_camera(room, tmp_path):
    from PIL import Image

    scene = str(room / "room.glb")
    images = {}
    for name in ("1", "door", "near"):
        path = tmp_path / f"{name}.png"
        more = ["--config", str(room / "few.json"), "--size", "64x48", "--camera", name, "-q"]
        assert run(["render", scene, "-o", str(path), *more]) == 0
        images[name] = np.asarray(Image.open(path)).astype(int)
    np.testing.assert_array_equal(images["1"], images["door"])
    assert np.abs(images["near"] - images["door"]).mean() > 3.0


@pytest.mark.slow
def test_a_fit_takes_all_cameras_and_views_of_ones_own(room, tmp_path):
    """All cameras share the views. A file's views are fitted as they are; what it lacks is placed."""
    common = ["--config", str(room / "small.json"), "-q"]
    scene, out = str(room / "room.glb"), tmp_path / "all"
    small = ["--size", "32x24", "--views", "2"]
    assert run(["fit", scene, "-o", str(out), "--camera", "all", *small, *common]) == 0
    fitted = [view for view in read_views(out / "views.json") if view.split == "fitted"]
    cameras = read_scene(scene).cameras
    assert len(fitted) == 2
    for view, camera in zip(fitted, cameras, strict=True):
        np.testing.assert_allclose(view.camera.to_world, camera.to_world, atol=1e-6)

    write_views(tmp_path / "mine.json", scene, (replace(fitted[1], name="mine"),))
    out = tmp_path / "own"
    assert run(["fit", scene, "-o", str(out), "--views", str(tmp_path / "mine.json"), *common]) == 0
    views = read_views(out / "views.json")
    assert [view.name for view in views if view.split == "fitted"] == ["mine"]
    assert {view.split for view in views} == {"fitted", "validation", "held_out"}
    notes = json.loads((out / "metrics.json").read_text())["notes"]
    assert "none of the views given is held out: such views are placed automatically" in notes
