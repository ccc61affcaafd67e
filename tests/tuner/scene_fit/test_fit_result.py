"""How a result shows itself: one short line, and HTML in which everything is escaped."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import FitNote, TunedConfig, read_config
from vpltune.tuner.evaluation.evaluate import Evaluation
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.scene_fit.fit_result import FitResult

FIGURES = {
    "relmse": 0.25,
    "trimmed_relmse": 0.2,
    "median_error": 0.1,
    "energy_ratio": 0.875,
    "flip": 0.0625,
}
START = ArtistParameters()
TUNED = replace(START, intensity=1.25, falloff_footprint=0.5)
HOSTILE = "<script>alert('x')</script> & \"y\""


def result_with(**changes) -> FitResult:
    """A result of which everything is made up."""
    split = {name: FIGURES for name in ("default", "ceiling")} | {"tuned": {**FIGURES, "relmse": 0.125}}
    document = {
        "sentence": f"better in {HOSTILE}",
        "metrics": {"fitted": split, "held_out": split},
        "uncertainty": {
            "intensity": {"low": 1.1, "high": 1.4, "determined": True},
            "falloff_footprint": {"low": 0.1, "high": 9.0, "determined": False},
        },
    }
    result = FitResult(
        config=TunedConfig(TUNED, fit=FitNote("improved")),
        status="improved",
        descent=Descent(np.zeros(3), 0.5, 1.0, np.array([1.0, 0.5]), FitStatus.CONVERGED),
        evaluation=Evaluation((), START),
        notes=(f"a note of {HOSTILE}",),
        document=document,
        fitted=TUNED,
        start=START,
        views=(),
        comparison=np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3),
    )
    return replace(result, **changes)


class Tags(HTMLParser):
    """Collects the tags and the text, and checks that every tag is closed."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags, self.text, self.open = [], "", []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_the_short_form_says_how_it_ended_what_changed_and_the_errors():
    assert repr(result_with()) == (
        "FitResult(improved: intensity 1 → 1.25, falloff_footprint 1 → 0.5; "
        "relMSE of held-out views 0.25 by default, 0.125 as returned)"
    )
    kept = result_with(config=TunedConfig(START), status="kept")
    assert repr(kept).startswith("FitResult(kept: nothing changed; relMSE")


def test_the_short_form_without_light_or_held_out_views():
    document = result_with().document
    only_fitted = {**document, "metrics": {**document["metrics"], "held_out": {}}}
    assert "relMSE of fitted views 0.25" in repr(result_with(document=only_fitted))
    dark = {name: {**FIGURES, "relmse": float("nan")} for name in ("default", "tuned", "ceiling")}
    unlit = {**document, "metrics": {"fitted": dark, "held_out": dark}}
    assert "no indirect light" in repr(result_with(document=unlit))
    assert "<td>–</td>" in result_with(document=unlit)._repr_html_()


def test_the_html_has_parameters_metrics_and_the_reason():
    parsed = Tags(result_with()._repr_html_())
    assert parsed.tags.count("table") == 2
    assert set(parsed.tags) <= {
        "div",
        "p",
        "b",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "ul",
        "li",
        "img",
    }
    words = " ".join(parsed.text.split())
    for expected in (
        "improved : better in",
        "k intensity",
        "1.1 to 1.4",
        "0.1 to 9, not determined",
        "0.875",
    ):
        assert expected.replace(" :", ":") in words, expected
    # Of the parameters that are not fitted, only those that changed have a row.
    assert "vpl_count" not in words


def test_everything_is_escaped():
    """The sentence and the notes may hold names from a file: they are text, never a tag."""
    html = result_with()._repr_html_()
    assert "script" not in Tags(html).tags
    assert Tags(html).text.count(HOSTILE) == 2


def test_the_image_is_inside():
    result = result_with()
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', result._repr_html_())
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))
    np.testing.assert_array_equal(shown, result.comparison)


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        (
            TunedConfig(TUNED, fit=FitNote("improved")),
            "TunedConfig(k 1.25, α 0.5, κ 0, 512 VPLs, maps, improved)",
        ),
        (TunedConfig(visibility="transmittance"), "TunedConfig(k 1, α 1, κ 0, 512 VPLs, transmittance)"),
        (read_config("auto"), "TunedConfig(auto, 512 VPLs, maps)"),
    ],
)
def test_a_config_says_what_it_draws_with(config, expected):
    assert repr(config) == expected
