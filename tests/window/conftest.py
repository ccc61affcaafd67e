"""A window on the shipped Cornell box, drawn with little work."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from window_talk import Talk

import vpltune
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, write_config

SCENE = Path(__file__).parents[2] / "configs" / "scenes" / "cornell-box.glb"


def light_work() -> TunedConfig:
    """A config that llvmpipe draws in a tenth of the default's time."""
    default = vpltune.read_config("default")
    return replace(
        default,
        parameters=replace(default.parameters, vpl_count=32),
        quality=Quality(map_size=8, rsm_resolution=128),
    )


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """Unsaved changes of one test do not come back in another."""
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def scene_file(tmp_path) -> Path:
    """A copy of the scene that a test may change or delete."""
    return Path(shutil.copy(SCENE, tmp_path / "box.glb"))


@pytest.fixture
def config_file(tmp_path) -> Path:
    path = tmp_path / "tuned.json"
    write_config(path, light_work())
    return path


@pytest.fixture
def window(own_cache, scene_file, config_file):
    with vpltune.view(scene_file, config_file) as opened:
        yield opened


@pytest.fixture
def talk(window):
    with Talk(window.address) as talk:
        yield talk
