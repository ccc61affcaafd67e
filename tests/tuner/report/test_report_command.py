"""`vpltune report`: the pages it writes, the input it rejects, and the size limit of a page."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from planted_metrics import PLANTED, change_metrics

from vpltune.cli.program import run
from vpltune.renderer.errors import InputError
from vpltune.tuner.evaluation.view_images import MAXIMUM_PIXELS
from vpltune.tuner.report.fit_folder import read_fit_folder
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES
from vpltune.tuner.report.scene_page import scene_page


def test_it_names_the_page_it_wrote(fit_copy, capfd):
    assert run(["report", str(fit_copy), "--json"]) == 0
    written = {"pages": [str(fit_copy / "report.html")], "problems": [], "status": "ok"}
    assert json.loads(capfd.readouterr().out) == written
    assert (fit_copy / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert not [path for path in fit_copy.iterdir() if path.name.startswith(".")]


def test_what_is_no_fit_is_refused(tmp_path, capfd):
    assert run(["report", str(tmp_path)]) == 2
    assert "metrics.json" in capfd.readouterr().err
    assert run(["report", str(tmp_path / "absent")]) == 2


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"loss": [1, 2]}, "key 'loss' must be an object"),
        ({"per_view": {"a": 1}}, "key 'per_view' must be a list"),
        ({"per_view": [1]}, "key 'per_view' must hold objects, got 1"),
        ({"uncertainty": {"intensity": 3}}, "key 'uncertainty' must hold objects, got 3"),
        ({"pareto": ["x"]}, "key 'pareto' must hold objects, got 'x'"),
        ({"loss": {"curve": [1e308] * 3}}, "numbers must be at most 1e+100, got 1e+308"),
    ],
)
def test_a_wrong_kind_of_value_is_refused_by_its_key(fit_copy, capfd, keys, words):
    change_metrics(fit_copy, **keys)
    assert run(["report", str(fit_copy)]) == 2
    assert words in capfd.readouterr().err
    assert not (fit_copy / "report.html").exists()


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000])
def test_metrics_that_are_none_are_refused(fit_copy, capfd, text):
    (fit_copy / "metrics.json").write_text(text, encoding="utf-8")
    assert run(["report", str(fit_copy)]) == 2
    assert "metrics.json" in capfd.readouterr().err


def test_values_that_are_no_numbers_are_dashes(fit_copy):
    """Strict JSON writes NaN as null, and a file edited by hand may hold anything."""
    figures = {"relmse": None, "energy_ratio": math.nan, "flip": "low"}
    change_metrics(
        fit_copy,
        metrics={"fitted": {"default": figures, "tuned": None, "ceiling": 3}, "held_out": {}},
        seconds={"fit": None, "total": None},
        loss={"curve": [None, None]},
        parameters={"intensity": None},
    )
    page = scene_page(read_fit_folder(fit_copy))
    words = re.sub(r"<style.*?</style>|<script.*?</script>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert "–" in words
    assert not re.search(r"\b(nan|inf|None|null|low)\b", words)
    assert "Loss at every step" not in page


def test_a_byte_order_mark_before_the_figures_is_passed_over(fit_copy):
    path = fit_copy / "metrics.json"
    plain = read_fit_folder(fit_copy).document
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_fit_folder(fit_copy).document == plain


def test_a_fit_without_images_has_a_page_all_the_same(fit_copy):
    (fit_copy / "images.npz").unlink()
    page = scene_page(read_fit_folder(fit_copy))
    assert "kept no images" in page
    assert "Against the path tracer" in page


def as_version_0_1_0(value):
    """A document with the names that version 0.1.0 wrote."""
    older = {
        "extinction_coefficient": "falloff_transmittance",
        "lloyd_iterations": "density_relaxation",
        "error_breakdown": "error_budget",
        "map_size": "visibility_map_size",
    }
    if isinstance(value, dict):
        return {older.get(key, key): as_version_0_1_0(each) for key, each in value.items()}
    if isinstance(value, list):
        return [older.get(each, each) if isinstance(each, str) else as_version_0_1_0(each) for each in value]
    return value


def test_a_folder_of_version_0_1_0_has_the_same_page(fit_copy):
    """It wrote pictures.npz, called two parameters and the error's split otherwise, and had no quality."""
    change_metrics(fit_copy, **PLANTED)
    page = scene_page(read_fit_folder(fit_copy))
    for words in ("extinction coefficient", "Lloyd iterations", "map size 16", "missing bounces"):
        assert words.lower() in page.lower()
    document = json.loads((fit_copy / "metrics.json").read_text(encoding="utf-8"))
    del document["quality"]
    older = as_version_0_1_0(document)
    assert {"falloff_transmittance", "density_relaxation"} < set(older["parameters"])
    assert older["budget"]["choice"]["visibility_map_size"] == 16
    (fit_copy / "metrics.json").write_text(json.dumps(older), encoding="utf-8")
    (fit_copy / "images.npz").rename(fit_copy / "pictures.npz")
    assert scene_page(read_fit_folder(fit_copy)) == page


@pytest.mark.slow
def test_many_large_noisy_views_do_not_make_a_page_too_large(fit_copy):
    """Noise does not compress: the page leaves out images, says so, and keeps the figures of all views."""
    fit = read_fit_folder(fit_copy)
    random = np.random.default_rng(0)
    shape = (192, 256)
    assert shape[0] * shape[1] == MAXIMUM_PIXELS

    def noise():
        return random.lognormal(0.0, 2.0, (*shape, 3)).astype(np.float32)

    images = tuple(
        replace(
            fit.images[0],
            index=index,
            valid=np.ones(shape, bool),
            reference_albedo=noise() / 1e3,
            reference_direct=noise(),
            albedo=noise() / 1e3,
            direct=noise(),
            indirect={name: noise() for name in fit.images[0].indirect},
        )
        for index in range(8)
    )
    measured = [{**fit.document["per_view"][0], "name": f"noisy_{index}"} for index in range(8)]
    document = {**fit.document, "per_view": measured}
    page = scene_page(replace(fit, images=images, document=document))
    assert len(page.encode("utf-8")) < MAXIMUM_PAGE_BYTES
    assert "more views were measured" in page
    assert page.count('class="view"') >= 1
    assert all(f"noisy_{index}" in page for index in range(8))


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
FIGURES = (
    "relmse",
    "energy_ratio",
    "flip",
    "noise_floor",
    "default",
    "tuned",
    "ceiling",
    "fitted",
    "held_out",
)
DOUBTS = ("value", "low", "high", "determined", "trades_with", "intensity", "views", "total", "curve")
FRAMES = ("milliseconds", "budget_milliseconds", "frame_size", "choice", "vpl_count", "parameters", "config")
WORDS = ("scene", "status", "sentence", "visibility", "notes", "provenance")
PARTS = (
    "parameters",
    "metrics",
    "seconds",
    "loss",
    "uncertainty",
    "error_breakdown",
    "budget",
    "per_view",
    "pareto",
)
OBJECTS = st.dictionaries(st.sampled_from(FIGURES + DOUBTS + FRAMES), JSON_VALUES, max_size=4)
OBJECTS |= st.dictionaries(st.sampled_from(FIGURES + DOUBTS + FRAMES), OBJECTS, max_size=4)
DOCUMENTS = st.dictionaries(
    st.sampled_from(WORDS + PARTS), JSON_VALUES | OBJECTS | st.lists(OBJECTS, max_size=3)
)


@given(document=DOCUMENTS)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
def test_whatever_metrics_hold_there_is_a_page_or_one_line(tmp_path_factory, document):
    folder = tmp_path_factory.getbasetemp() / "any-metrics"
    folder.mkdir(exist_ok=True)
    (folder / "metrics.json").write_text(json.dumps(document), encoding="utf-8")
    try:
        page = scene_page(read_fit_folder(folder))
    except InputError as error:
        assert "\n" not in str(error)
        assert "metrics.json" in str(error)
    else:
        assert page.endswith("</html>")
