"""What is printed at the end of a command, and while it works."""

import io
import json
import math

import pytest
from rich.console import Console

from vpltune.cli import progress_display
from vpltune.cli.metrics_table import metrics_table, parameters_table
from vpltune.cli.progress_display import shown_progress
from vpltune.cli.report import print_json
from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters


def text_of(table):
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def scores(relmse):
    return {
        "relmse": relmse,
        "trimmed_relmse": 0.0312,
        "worst_share": 0.25,
        "median_error": 0.017,
        "energy_ratio": 1.25,
        "flip": 0.0625,
    }


def test_the_metrics_table_shows_every_number_in_80_columns():
    metrics = {
        "fitted": {
            "default": scores(0.5),
            "tuned": scores(0.25),
            "ceiling": scores(0.125),
            "noise_floor": 1e-4,
        },
        "held_out": {
            "default": scores(0.6),
            "tuned": scores(0.3),
            "ceiling": scores(None),
            "noise_floor": None,
        },
    }
    text = text_of(metrics_table(metrics))
    assert max(map(len, text.splitlines())) <= 80
    rows = [line.replace("│", " ").split() for line in text.splitlines() if line.startswith("│")]
    default, held_out = [row for row in rows if row[0] == "default"]
    assert {"0.5", "0.0312", "25", "1.7", "1.25", "0.0625"} <= set(default)
    assert "0.6" in held_out
    assert [row[1] for row in rows if row[0] == "tuned"] == ["0.25", "0.3"]
    assert [row[1] for row in rows if row[0] == "ceiling"] == ["0.125", "–"]
    assert [row[2] for row in rows if row[0] == "noise"] == ["0.0001", "–"]


def test_the_parameters_table_has_values_defaults_and_units():
    text = text_of(parameters_table(ArtistParameters(intensity=1.5).as_dict(), {}))
    assert "1.5" in text
    assert "VPL footprints" in text
    assert "k  intensity" in text


@pytest.mark.parametrize(
    ("low", "high", "bias", "trades", "remark"),
    [
        (0.000333, 0.00253, 0.0005, ("intensity", "falloff_footprint", "visibility_bias"), "k, α, β"),
        (0.938, 0.969, 0.0007213, ("intensity",), "k"),
    ],
    ids=["long interval", "long value"],
)
def test_the_parameters_table_fits_into_80_columns(low, high, bias, trades, remark):
    """A line for each parameter and each remark, and nothing cut off."""
    interval = {"low": low, "high": high, "determined": False, "trades_with": trades}
    text = text_of(
        parameters_table(
            ArtistParameters(visibility_bias=bias).as_dict(), {"extinction_coefficient": interval}
        )
    )
    lines = [line.rstrip() for line in text.splitlines()]
    assert max(map(len, lines)) <= 80
    assert len(lines) == 2 + len(ARTIST_PARAMETERS) + 2
    assert "…" not in text
    assert f"{low} to {high}" in text
    assert f"trades with {remark}" in text
    assert sum(line.endswith("of the distance") for line in lines) == 2


def test_json_has_null_where_a_number_is_not_finite(capsys):
    print_json({"a": math.nan, "b": [math.inf, 1.5], "c": {"d": -math.inf}, "e": "text", "f": (1, True)})
    printed = json.loads(capsys.readouterr().out)
    assert printed == {"a": None, "b": [None, 1.5], "c": {"d": None}, "e": "text", "f": [1, True]}


def test_without_a_terminal_each_stage_is_one_line_on_stderr(capsys):
    with shown_progress() as progress:
        for stage, fraction in (("reference", 0.0), ("reference", 0.5), ("fit", 0.0), ("reference", 1.0)):
            progress(stage, fraction)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == "vpltune: reference\nvpltune: fit\n"


def test_a_long_stage_tells_percent_and_time_left(capsys, monkeypatch):
    """A quarter done after 30 s: 90 s are left; nothing more within the next ten."""
    clock = iter((0.0, 30.0, 35.0, 39.9))
    monkeypatch.setattr(progress_display.time, "monotonic", lambda: next(clock))
    with shown_progress() as progress:
        for fraction in (0.0, 0.25, 0.3, 0.4):
            progress("reference", fraction)
    assert capsys.readouterr().err == "vpltune: reference\nvpltune: reference 25%, 90 s left\n"


def test_on_a_terminal_stages_are_bars(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with shown_progress() as progress:
        progress("reference", 0.5)
        progress("fit", 1.0)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "reference" in shown.err
    assert "fit" in shown.err
