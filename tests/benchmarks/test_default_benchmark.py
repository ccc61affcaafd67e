"""`bench default`: its rows from made-up figures, which scenes chose nothing, and that a run continues."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.harness.scene_library import OUTSIDE_SCENES, present_scenes
from benchmarks.tuning import default
from benchmarks.tuning.default import FIGURES, Measured, measured, ratio_rows, sources, table, write_front


def figures(error, milliseconds):
    return {**dict.fromkeys(FIGURES, error), "off_share": 0.01, "milliseconds": milliseconds}


def scene(name, chose, error, milliseconds):
    """A scene that the old default draws in 100 ms with an error of 0.1."""
    return Measured(name, chose, {"old": figures(0.1, 100.0), "default": figures(error, milliseconds)})


SCENES = [scene("a", False, 0.05, 20.0), scene("b", False, 0.08, 40.0), scene("c", True, 0.02, 10.0)]


def test_rows_are_ratios_to_the_old_default_by_group():
    rows = {row.name: row.value for row in ratio_rows(SCENES)}
    assert rows["unseen.relmse_ratio"] == pytest.approx(0.65)
    assert rows["unseen.worst_trimmed_ratio"] == pytest.approx(0.8)
    assert rows["unseen.time_ratio"] == pytest.approx(0.3)
    assert rows["chosen_on.worst_time_ratio"] == pytest.approx(0.1)
    assert {row.name.split(".")[0] for row in ratio_rows(SCENES[:2])} == {"unseen"}


def test_scenes_that_are_kept_away_chose_nothing():
    """By the rules of docs/chosen_on.md."""
    chose = {name: chosen for name, (_, chosen) in sources().items()}
    assert default.CHOOSING_SEED % 3 != 2
    assert default.REPORTED_SEED % 3 == 2
    generated = [chose[name] for name in chose if name.endswith(f"-of-{default.CHOOSING_SEED}")]
    assert generated == [True] * default.GENERATED
    generated = [chose[name] for name in chose if name.endswith(f"-of-{default.REPORTED_SEED}")]
    assert generated == [False] * default.GENERATED
    kept_away = {"bevy-depthoffieldexample", "cube2-steelribs", "kajiya-cornell-box", "playcanvas-house"}
    assert set(default.RESERVED) == set(kept_away)
    # Scenes of others are not in the repository.
    assert kept_away <= set(OUTSIDE_SCENES)
    present = [name for name in default.RESERVED if name in present_scenes()]
    assert [chose[name] for name in present] == [False] * len(present)
    assert chose["gallery"]


def test_the_old_default_is_that_of_version_1():
    from config_documents import older_document

    from vpltune.renderer.config.tuned_config import parse_config
    from vpltune.renderer.files.strict_json import strict_json

    assert parse_config(strict_json(older_document()), "older.json") == default.OLD


def test_beads_are_pixels_that_are_off_by_more_than_they_hold():
    """One of ten pixels is off by twice the mean; another by less than its own light."""
    reference, drawn = np.ones((2, 5, 3)), np.ones((2, 5, 3))
    reference[0, 0] = 4.0
    drawn[0, 0], drawn[1, 2] = 6.0, 5.0
    view = SimpleNamespace(
        valid=np.ones((2, 5), bool),
        reference=SimpleNamespace(irradiance=reference),
        captured=SimpleNamespace(indirect_irradiance=drawn),
    )
    assert default._off_share(view) == pytest.approx(0.1)


def test_table_and_plot(tmp_path):
    text = table(SCENES, ["default"])
    assert "| a | default | 0.50 | 0.50 | 0.50 | 0.50 | 0.20 |" in text
    assert text.splitlines()[-1].startswith("| median | default | 0.500 |")
    write_front(tmp_path / "front.png", SCENES, ["old", "default"])
    assert (tmp_path / "front.png").read_bytes()[:4] == b"\x89PNG"


def test_an_interrupted_run_continues(tmp_path, monkeypatch):
    """What a former run has left is read; a config that it lacked is measured, and a dark scene left out."""
    asked = []

    def measure(made, configs, context):
        asked.append((made, list(configs)))
        return {name: {} if made == "dark" else figures(0.1, 1.0) for name in configs}

    monkeypatch.setattr(default, "REPOSITORY", tmp_path)
    monkeypatch.setattr(default, "program_digest", lambda benchmark: "digest")
    monkeypatch.setattr(default, "_figures", measure)
    scenes = {name: (lambda name=name: name, False) for name in ("lit", "dark")}
    first = measured({"old": default.OLD}, scenes, lambda name, share: None)
    again = measured({"old": default.OLD, "default": default.DEFAULT}, scenes, lambda name, share: None)
    assert asked == [("lit", ["old"]), ("dark", ["old"]), ("lit", ["default"]), ("dark", ["default"])]
    assert [each.name for each in first] == [each.name for each in again] == ["lit"]
    assert again[0].ratio("relmse") == 1.0
