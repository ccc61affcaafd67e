"""A config with a prior as the start of a fit, and evaluated."""

import pytest
from made_priors import made_prior

from vpltune import configs
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.scene_fit.evaluate_scene import EvaluateOptions, evaluate_scene
from vpltune.tuner.scene_fit.prior_in_fit import fit_start

BASE = ArtistParameters(vpl_count=16)
CONFIG = TunedConfig(BASE, visibility="maps", auto=made_prior(strength=0.05))


def test_a_fit_starts_in_the_middle_of_what_the_prior_set():
    """It is their mean, on the scale of the parameter table. All other parameters come from the config."""
    drawn = [
        ArtistParameters(intensity=value, visibility_bias=bias) for value, bias in ((0.5, 0.01), (2.0, 0.04))
    ]
    start = fit_start(CONFIG, drawn)
    assert start.intensity == pytest.approx(1.0)
    assert start.visibility_bias == pytest.approx(0.02)
    assert start.vpl_count == 16
    assert fit_start(TunedConfig(BASE), ()) == BASE


@pytest.mark.slow
def test_evaluate_with_a_prior(tmp_path, monkeypatch):
    """`tuned` is rendered with what the prior sets in each view, `default` without the prior."""
    from pathlib import Path

    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path))
    scene = Path(configs.__file__).parent / "scenes" / "cornell-box.glb"
    options = EvaluateOptions(tuned=CONFIG, views=1, size=(24, 18))
    document = evaluate_scene(scene, options, lambda stage, share: None).document
    assert document["status"] == "ok"
    assert all(view["parameters"] != BASE.as_dict() for view in document["per_view"])
    fitted = document["metrics"]["fitted"]
    assert fitted["tuned"]["relmse"] != fitted["default"]["relmse"]
