"""Fixtures: one small real fit and one browser, shared by all tests of pages."""

import shutil
from pathlib import Path

import pytest
from headless_chromium import headless_chromium
from quick_fit import QUICK_FIT

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig

SCENE = Path(__file__).resolve().parents[3] / "configs" / "scenes" / "cornell-box.glb"


@pytest.fixture(scope="session")
def fitted_folder(tmp_path_factory) -> Path:
    """The output of `vpltune fit` for the shipped Cornell box, with few VPLs and pixels and one bounce."""
    from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene

    folder = tmp_path_factory.mktemp("report") / "fit"
    start = TunedConfig(QUICK_FIT, quality=Quality(map_size=8, rsm_resolution=256), light=ONE_BOUNCE)
    options = FitOptions(start=start, views=1, size=(32, 24), command="vpltune fit box.glb -o 'my out'")
    fit_scene(SCENE, folder, options, lambda stage, share: None)
    return folder


@pytest.fixture
def fit_copy(fitted_folder, tmp_path) -> Path:
    """A copy of `fitted_folder` that a test may change."""
    return Path(shutil.copytree(fitted_folder, tmp_path / "fit"))


@pytest.fixture(scope="session")
def chromium(playwright):
    with headless_chromium(playwright) as browser:
        yield browser
