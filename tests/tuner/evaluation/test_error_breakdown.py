"""The error split by cause: what each share is when the cause is known."""

from pathlib import Path

import numpy as np
import pytest

from vpltune import configs
from vpltune.cli.metrics_table import error_breakdown_table
from vpltune.renderer.config.light_settings import ONE_BOUNCE

CORNELL = Path(configs.__file__).parent / "scenes" / "cornell-box.glb"


@pytest.fixture(scope="module")
def budgets(tmp_path_factory):
    """The Cornell box with 64 VPLs, without and with visibility maps, on two small views."""
    from vpltune.renderer.config.artist_parameters import ArtistParameters
    from vpltune.renderer.config.tuned_config import TunedConfig
    from vpltune.tuner.scene_fit.evaluate_scene import EvaluateOptions, evaluate_scene

    found = {}
    for visibility in ("transmittance", "maps"):
        tuned = TunedConfig(ArtistParameters(vpl_count=64), light=ONE_BOUNCE).seen_by(visibility)
        options = EvaluateOptions(views=1, size=(32, 24), tuned=tuned, split_error=True)
        found[visibility] = evaluate_scene(CORNELL, options, lambda stage, share: None).document
    return found


def test_the_causes_add_up(budgets):
    for document in budgets.values():
        budget = dict(document["error_breakdown"])
        assert budget.pop("views") == "fitted"
        assert set(budget) == {"noise", "finite_n", "clamping", "visibility", "filter", "remainder"}
        total = document["metrics"]["fitted"]["tuned"]["relmse"]
        assert sum(budget.values()) == pytest.approx(total, rel=1e-6)


def test_without_maps_visibility_is_what_is_wrong(budgets):
    """Most of the error is light through the boxes; maps take most of that share away."""
    without, with_maps = (budgets[key]["error_breakdown"] for key in ("transmittance", "maps"))
    assert without["visibility"] > 0.5 * budgets["transmittance"]["metrics"]["fitted"]["tuned"]["relmse"]
    assert with_maps["visibility"] < 0.5 * without["visibility"]


def test_the_runtime_is_the_plain_gather(budgets):
    """No filter was used, so its share is what twins differ by: 1e-3 relative RMSE, squared, at most."""
    for document in budgets.values():
        assert (
            abs(document["error_breakdown"]["filter"])
            < 1e-3 * document["metrics"]["fitted"]["tuned"]["relmse"]
        )


def test_the_noise_is_the_floor(budgets):
    for document in budgets.values():
        assert document["error_breakdown"]["noise"] == document["metrics"]["fitted"]["noise_floor"]


def test_fewer_vpls_are_noisier(budgets):
    assert np.isfinite(budgets["maps"]["error_breakdown"]["finite_n"])
    assert budgets["maps"]["error_breakdown"]["finite_n"] > 0.0


def test_the_table_is_sorted_and_absent_without_a_split(budgets):
    from rich.console import Console

    assert error_breakdown_table({"metrics": {}}) == ()
    console = Console(width=100)
    with console.capture() as shown:
        console.print(*error_breakdown_table(budgets["transmittance"]))
    lines = [line for line in shown.get().splitlines() if "%" in line]
    assert "visibility" in lines[0]
    assert "remainder" in lines[-2]
    assert "all" in lines[-1]


def _small_views(path):
    from vpltune.renderer.scene.files import read_scene
    from vpltune.renderer.scene.placement import resolve_camera_and_lights, views_for_scene
    from vpltune.renderer.scene.views import write_views

    scene = read_scene(CORNELL)
    camera, lights, _ = resolve_camera_and_lights(scene, CORNELL, None, None)
    write_views(
        path,
        str(CORNELL),
        views_for_scene(scene, camera, lights, fitted=1, held_out=1, size=(32, 24), seed=0),
    )
