"""A disk that is full or read-only: one line that names the file, and nothing half-written."""

import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.export.scene_bundle import SceneBundle, write_bundle
from vpltune.renderer.files import atomic_file, unfinished_files
from vpltune.renderer.files.atomic_file import (
    require_writable,
    write_text_whole,
    written_together,
    written_whole,
)
from vpltune.renderer.files.image_file import write_exr, write_png
from vpltune.renderer.files.video_file import clip_writer
from vpltune.tuner.prior.train_prior import write_prior

REPOSITORY = Path(__file__).resolve().parents[3]
NOISE = np.random.default_rng(0).integers(0, 256, (256, 256, 3), np.uint8)
"""196 kB that no writer can compress."""
LIMIT_BYTES = 100_000
UNDER_A_LIMIT = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
sys.argv = ["vpltune", *{arguments!r}]
from vpltune.cli.program import run
sys.exit(run(sys.argv[1:]))
"""
"""A file may not grow beyond the limit; to a program that ignores the signal, that is a full disk (EFBIG)."""


def clip(path):
    with clip_writer(path, (256, 256), 30.0) as write:
        for shift in range(8):
            write(np.roll(NOISE, 16 * shift, axis=0))


WRITERS = {
    "picture.png": lambda path: write_png(path, NOISE),
    "picture.exr": lambda path: write_exr(path, NOISE.astype(np.float32)),
    "clip.mp4": clip,
    "frames": clip,
    "text.json": lambda path: write_text_whole(path, "x" * 2 * LIMIT_BYTES),
}


@pytest.fixture
def small_files():
    """Files of at most `LIMIT_BYTES`: Python ignores SIGXFSZ, so writes fail as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", WRITERS)
def test_what_does_not_fit_is_named_and_leaves_the_old_file(tmp_path, small_files, name):
    path = tmp_path / name
    if path.suffix:
        path.write_text("old")
    with pytest.raises(MachineError, match=str(path)) as caught:
        WRITERS[name](path)
    assert "\n" not in str(caught.value)
    left = [each.read_text() for each in tmp_path.rglob("*") if each.is_file()]
    assert left == ["old"] * bool(path.suffix)


def test_a_file_that_stays_empty_is_no_success(tmp_path):
    """Some libraries report nothing: what they wrote is looked at."""
    with pytest.raises(MachineError, match="stayed empty"), written_whole(tmp_path / "x.png"):
        pass
    assert not list(tmp_path.iterdir())


def test_a_set_changes_whole(tmp_path, small_files):
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_text("old")
    with pytest.raises(MachineError) as caught, written_together(tmp_path) as folder:
        write_text_whole(folder / "a.txt", "new")
        write_text_whole(folder / "b.txt", "x" * 2 * LIMIT_BYTES)
    assert str(caught.value).startswith(f"{tmp_path / 'b.txt'}: cannot be written (")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "old", "b.txt": "old"}
    with written_together(tmp_path) as folder:
        write_text_whole(folder / "a.txt", "new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "new", "b.txt": "old"}
    (tmp_path / "c.txt").mkdir()
    refusal = f"{tmp_path / 'c.txt'}: cannot be written .it is a folder."
    with pytest.raises(InputError, match=refusal), written_together(tmp_path) as folder:
        write_text_whole(folder / "b.txt", "new")
        write_text_whole(folder / "c.txt", "new")
    assert (tmp_path / "b.txt").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.txt", "c.txt"]


def test_a_set_takes_the_place_of_an_earlier_one_with_other_files(tmp_path):
    """And only if it is written; files of others stay."""
    with written_together(tmp_path) as folder:
        for name in ("a.txt", "front.csv", "front/0.json", "front/1.json"):
            write_text_whole(folder / name, "old")
    (tmp_path / "front" / "mine.txt").write_text("mine")
    earlier = ("front.csv", "front/[0-9]*.json")
    with pytest.raises(MachineError), written_together(tmp_path, earlier):
        raise MachineError("full")
    assert (tmp_path / "front" / "1.json").read_text() == "old"
    with written_together(tmp_path, earlier) as folder:
        write_text_whole(folder / "a.txt", "new")
        write_text_whole(folder / "front" / "0.json", "new")
    left = {
        str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*") if path.is_file()
    }
    assert left == {"a.txt": "new", "front/0.json": "new", "front/mine.txt": "mine"}


def test_a_set_may_have_folders(tmp_path):
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "mine.txt").write_text("mine")
    with written_together(tmp_path) as folder:
        write_text_whole(folder / "below" / "a.txt", "new")
        write_text_whole(folder / "far" / "off" / "b.txt", "new")
    left = {str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*.txt")}
    assert left == {"below/mine.txt": "mine", "below/a.txt": "new", "far/off/b.txt": "new"}
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(InputError, match="must be a folder, got a file"),
        written_together(tmp_path) as folder,
    ):
        write_text_whole(folder / "below" / "a.txt", "newer")
        write_text_whole(folder / "file" / "b.txt", "newer")
    assert (tmp_path / "below" / "a.txt").read_text() == "new"


def test_a_prior_and_its_card_change_together(tmp_path, small_files):
    output = tmp_path / "prior.json"
    write_prior(output, TunedConfig(), "old")
    with pytest.raises(MachineError, match=r"prior\.md: cannot be written"):
        write_prior(output, TunedConfig(), "x" * 2 * LIMIT_BYTES)
    with pytest.raises(InputError, match="provenance"):
        write_prior(output, TunedConfig(provenance={"seconds": math.nan}), "new")
    assert (tmp_path / "prior.md").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["prior.json", "prior.md"]


def test_a_bundle_changes_whole(tmp_path, small_files):
    """The document says where things lie in the other file."""
    write_bundle(tmp_path, SceneBundle({"is": "old"}, b"old"))
    with pytest.raises(MachineError, match="bundle.json: cannot be written"):
        write_bundle(tmp_path, SceneBundle({"is": "x" * 2 * LIMIT_BYTES}, b"new"))
    assert (tmp_path / "bundle.bin").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bundle.bin", "bundle.json"]


def test_a_folder_is_tried_before_the_work(tmp_path, monkeypatch):
    require_writable(tmp_path / "not" / "there")
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="must be a folder, got a file"):
            require_writable(path)

    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(unfinished_files.tempfile, "mkstemp", refuse)  # root may write anywhere
    with pytest.raises(MachineError, match="Permission denied"):
        require_writable(tmp_path)


@pytest.mark.parametrize(
    "arguments",
    [
        ["render", "{room}", "-o", "x.png"],
        ["render", "{room}", "-o", "x.mp4", "--frames", "2"],
        ["fit", "{room}", "-o", "out"],
        ["batch", "{library}", "-o", "out"],
        ["export", "default", "--to", "glsl", "-o", "x.glsl"],
        ["export", "default", "--to", "bundle", "--scene", "{room}", "-o", "bundle"],
        ["import", "{mitsuba}", "-o", "x.glb"],
        ["train-prior", "-o", "x.json"],
        ["report", "fitted"],
    ],
    ids=lambda arguments: "-".join(arguments[:1] + arguments[-2:]),
)
def test_commands_look_before_they_work(tmp_path, arguments):
    """On a disk without room, in less processor time than a scene takes to read: exit 3, one line."""
    room = REPOSITORY / "configs" / "scenes" / "gallery.glb"
    (tmp_path / "fitted").mkdir()
    (tmp_path / "fitted" / "metrics.json").write_text("{}")
    scene = tmp_path / "scene.xml"
    scene.write_text('<scene version="3.0.0"><shape type="rectangle"/></scene>')
    places = {"room": room, "library": room.parent, "mitsuba": scene}
    filled = [each.format(**places) for each in arguments]
    # Less than require_writable tries.
    program = UNDER_A_LIMIT.format(limit=atomic_file.TRIAL_BYTES // 2, arguments=filled)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "VPLTUNE_CACHE": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 3, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "cannot be written" in done.stderr
    left = [path for path in tmp_path.rglob("*") if path.is_file() and "cache" not in path.parts]
    assert sorted(path.name for path in left) == ["metrics.json", "scene.xml"]
