"""A scene whose surfaces send each other no light, end to end: said in a sentence, and no failure."""

import json

import pytest

from vpltune.cli.program import run

# A single plate: whatever light it sends, nothing is there to receive it.
PLATE = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n"
SMALL = ("--views", "1", "--size", "32x24", "--json")

pytestmark = pytest.mark.slow  # whole fits, each with placement and compilation


@pytest.fixture
def plate(tmp_path):
    path = tmp_path / "library" / "plate.obj"
    path.parent.mkdir()
    path.write_text(PLATE)
    return path


@pytest.mark.parametrize("more", [(), ("--vpl-count", "16", "--split-error"), ("--budget-ms", "100")])
def test_a_fit_keeps_the_start_and_says_why(plate, tmp_path, capfd, more):
    assert run(["fit", str(plate), "-o", str(tmp_path / "fit"), *SMALL, *more]) == 0
    shown = capfd.readouterr()
    document = json.loads(shown.out)
    assert document["status"] == "unlit"
    assert document["sentence"].startswith("no indirect light reaches the fitted views")
    assert document["parameters"]["intensity"] == 1.0
    for split in ("fitted", "held_out"):
        for variant in ("default", "tuned", "ceiling"):
            figures = document["metrics"][split][variant]
            assert (figures["relmse"], figures["energy_ratio"]) == (None, None)
            assert figures["flip"] < 0.01
    assert "relMSE and energy ratio have no value there" in shown.err


def test_an_evaluation_has_no_figures_and_is_done(plate, capfd):
    assert run(["evaluate", str(plate), "--config", "default", "--views", "1", "--json"]) == 0
    shown = capfd.readouterr()
    document = json.loads(shown.out)
    assert document["metrics"]["fitted"]["tuned"]["relmse"] is None
    assert "no indirect light reaches fitted_0, held_out_0" in shown.err


def test_a_batch_is_done_with_it_and_the_report_says_so(plate, tmp_path, capfd):
    out = tmp_path / "out"
    assert run(["batch", str(plate.parent), "-o", str(out), *SMALL]) == 0
    document = json.loads(capfd.readouterr().out)
    assert (document["status"], document["unlit"], document["done"]) == ("ok", 1, 0)
    assert document["records"][0]["status"] == "unlit"
    assert run(["report", str(out)]) == 0
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "1 unlit" in page
    assert "no indirect light reaches the fitted views" in page
