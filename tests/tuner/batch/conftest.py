"""Fixtures: jobs over small scene files, and a replacement for the fit."""

import hashlib
from pathlib import Path
from types import SimpleNamespace

import pytest

import vpltune.tuner.scene_fit.fit_scene
from vpltune.renderer.config.tuned_config import TunedConfig, config_text
from vpltune.tuner.batch.job import Job, JobOptions

CORNELL_BOX = Path(__file__).resolve().parents[3] / "configs" / "scenes" / "cornell-box.glb"


@pytest.fixture
def make_job(tmp_path):
    """Makes a job for `scene`, or for a new file that holds a few bytes and no scene."""

    def make(name: str = "room.glb", scene: Path | None = None, size: int = 1) -> Job:
        if scene is None:
            scene = tmp_path / "library" / name
            scene.parent.mkdir(exist_ok=True)
            scene.write_bytes(b"no scene")
        key = hashlib.sha256(str(scene).encode()).hexdigest()
        options = JobOptions(start=config_text(TunedConfig()), views=1, size=(32, 24))
        return Job(key, str(scene), name, str(tmp_path / "out"), options, size)

    return make


@pytest.fixture
def fits(monkeypatch):
    """Replaces `fit_scene`: `scenes` and `starts` list what was fitted; `error`, `status` and `files` set the
    result."""
    log = SimpleNamespace(scenes=[], starts=[], error=None, status="improved", files={"tuned.json": "{}"})

    def fit_scene(scene_path, output, options, progress):
        log.scenes.append(scene_path.name)
        log.starts.append(options.start)
        if log.error is not None:
            raise log.error
        output.mkdir(parents=True)
        for name, content in log.files.items():
            (output / name).write_text(content)
        seconds = {"fit": 1.0, "total": 2.0}
        return SimpleNamespace(document={"status": log.status, "sentence": "settled", "seconds": seconds})

    monkeypatch.setattr(vpltune.tuner.scene_fit.fit_scene, "fit_scene", fit_scene)
    return log
