"""`vpltune render --frames`: clips are written frame by frame, whole or not at all."""

import json
import subprocess
from pathlib import Path
from typing import get_args

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import vpltune.renderer.files.video_file
import vpltune.renderer.scene.sequence
from vpltune.cli.options import Motion
from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.renderer.frame.runtime import Runtime

# The encoder is started by fork and exec, of which JAX warns once an earlier test has loaded it; the command
# itself never loads JAX.
pytestmark = pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "cornell-box.glb"


@pytest.fixture
def render(tmp_path_factory):
    """The command with the default config, but few VPLs: what is drawn is another test's subject."""
    config = tmp_path_factory.mktemp("config") / "few.json"
    write_config(config, TunedConfig(ArtistParameters(vpl_count=32), quality=Quality(rsm_resolution=128)))

    def command(output, *more):
        common = ["--config", str(config), "--size", "32x24"]
        return run(["render", str(SCENE), "-o", str(output), *common, *more])

    return command


def decoded(path, size) -> np.ndarray:
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    frames = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(frames, np.uint8).reshape(-1, size[1], size[0], 3)


def test_motions_of_the_option_are_those_of_the_sequence():
    assert get_args(Motion) == vpltune.renderer.scene.sequence.MOTIONS


def test_an_mp4_has_the_frames_asked_for(render, tmp_path, capfd):
    path = tmp_path / "clip.mp4"
    assert render(path, "--frames", "6", "--fps", "3", "--json") == 0
    report = json.loads(capfd.readouterr().out)
    assert (report["frames"], report["fps"], report["output"]) == (6, 3.0, str(path))
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert (count, seconds) == (6, pytest.approx(2.0, abs=0.05))
    images = decoded(path, (32, 24))
    assert images.shape == (6, 24, 32, 3)
    assert np.abs(np.diff(images.astype(int), axis=0)).mean(axis=(1, 2, 3)).min() > 0.2, "nothing moves"
    assert [entry.name for entry in tmp_path.iterdir()] == ["clip.mp4"]


def test_a_folder_has_numbered_images_of_one_exposure(render, tmp_path, monkeypatch):
    """All frames have the exposure that the first was measured to need: clips must not pump.

    That it is the first one's own is `test_the_first_frame_is_the_still_image`.
    """
    exposures = []
    original = Runtime.render

    def seen(self, view, config, state=None, *, exposure=None, **more):
        exposures.append(exposure)
        return original(self, view, config, state, exposure=exposure, **more)

    monkeypatch.setattr(Runtime, "render", seen)
    folder = tmp_path / "frames"
    assert render(folder, "--frames", "3", "--motion", "light") == 0
    names = sorted(entry.name for entry in folder.iterdir())
    assert names == ["frame_00000.png", "frame_00001.png", "frame_00002.png"]
    assert exposures[0] == exposures[1] == exposures[2] > 0.0
    with Image.open(folder / "frame_00000.png") as first, Image.open(folder / "frame_00002.png") as third:
        assert first.size == (32, 24)
        assert np.abs(np.asarray(first, int) - np.asarray(third, int)).max() > 2


def test_the_first_frame_is_the_still_image(render, tmp_path):
    assert render(tmp_path / "frames", "--frames", "1") == 0
    assert render(tmp_path / "still.png") == 0
    with (
        Image.open(tmp_path / "still.png") as still,
        Image.open(tmp_path / "frames/frame_00000.png") as first,
    ):
        np.testing.assert_array_equal(np.asarray(first), np.asarray(still))


@pytest.mark.parametrize("layer", ["direct", "albedo", "normal", "depth"])
def test_every_layer_can_be_a_clip(render, tmp_path, layer):
    assert render(tmp_path / layer, "--frames", "2", "--layer", layer) == 0
    assert len(list((tmp_path / layer).iterdir())) == 2


def test_dynamic_lights_fly_in_clips(render, tmp_path):
    assert (
        render(tmp_path / "a", "--frames", "3", "--fps", "2", "--motion", "none", "--dynamic-lights", "40")
        == 0
    )
    images = []
    for name in ("frame_00000.png", "frame_00002.png"):
        with Image.open(tmp_path / "a" / name) as image:
            images.append(np.asarray(image, int))
    assert np.abs(images[0] - images[1]).max() > 5


def test_an_interrupt_leaves_no_half_clip(render, tmp_path, monkeypatch):
    drawn = []
    original = Runtime.render

    def interrupted(self, *arguments, **more):
        drawn.append(0)
        if len(drawn) == 3:
            raise KeyboardInterrupt
        return original(self, *arguments, **more)

    monkeypatch.setattr(Runtime, "render", interrupted)
    assert render(tmp_path / "clip.mp4", "--frames", "5") == 130
    assert list(tmp_path.iterdir()) == []


def test_frames_in_a_folder_change_together(render, tmp_path, monkeypatch):
    """An interrupt leaves the earlier clip; the next one replaces all of it, and nothing else there."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for name in ("frame_00000.png", "frame_00007.png", "frame_last.png", "notes.txt"):
        (folder / name).write_text("old")
    drawn = []
    original = Runtime.render

    def interrupted(self, *arguments, **more):
        drawn.append(0)
        if len(drawn) == 3:
            raise KeyboardInterrupt
        return original(self, *arguments, **more)

    with monkeypatch.context() as patch:
        patch.setattr(Runtime, "render", interrupted)
        assert render(folder, "--frames", "5") == 130
    assert {path.read_text() for path in folder.iterdir()} == {"old"}
    assert len(list(folder.iterdir())) == 4
    assert render(folder, "--frames", "2") == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        *("frame_00000.png", "frame_00001.png", "frame_last.png", "notes.txt")
    ]
    with Image.open(folder / "frame_00000.png") as first:
        assert first.size == (32, 24)


def test_a_clip_that_fails_leaves_the_old_one(render, tmp_path, monkeypatch):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"old")
    monkeypatch.setattr(Runtime, "render", lambda *arguments, **more: 1 / 0)
    assert render(path, "--frames", "2") not in (0, 2)
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("output", "more", "message"),
    [
        ("clip.mp4", ["--size", "33x24"], "an .mp4 must have even sides, got 33x24"),
        ("clip.gif", [], "a clip must be an .mp4 or a folder for .png files, got '.gif'"),
        ("file", [], "must be a folder for .png files, got a file"),
        ("clip.mp4", ["--fps", "0"], "--fps: must lie in [0.1, 1000], got 0.0"),
        ("clip.mp4", ["--fps", "nan"], "--fps: must lie in [0.1, 1000], got nan"),
        ("clip.mp4", ["--frames", "0"], "--frames"),
        ("clip.mp4", ["--motion", "up"], "--motion"),
    ],
)
def test_what_cannot_be_a_clip_is_refused_first(render, tmp_path, capfd, output, more, message):
    (tmp_path / "file").write_text("")
    assert render(tmp_path / output, "--frames", "2", *more) == 2
    assert message in capfd.readouterr().err
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
