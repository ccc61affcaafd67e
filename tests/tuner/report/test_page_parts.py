"""The parts of a page: axes, formatted values, error maps, charts, parameter rows."""

import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA, map_png, signed_error
from vpltune.tuner.metrics.tone_curve import display_image, tone_curve
from vpltune.tuner.metrics.view_metrics import hdr_flip, hdr_flip_map, relmse
from vpltune.tuner.report.charts import bar_chart, loss_chart, pareto_chart
from vpltune.tuner.report.page_text import NONE, change, number, seconds
from vpltune.tuner.report.parameter_rows import BAR_WIDTH, parameter_rows
from vpltune.tuner.report.scaled_axis import Axis, axis_around


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1024, "1 024"),
        (0.0, "0"),
        (0.12345, "0.123"),
        (-2.5, "−2.5"),
        (123456.0, "123 456"),
        (1.5e-7, "1.50 × 10⁻⁷"),
        (2e9, "2.00 × 10⁹"),
        (None, NONE),
        (math.nan, NONE),
        (math.inf, NONE),
        (10**400, NONE),
        ("3", NONE),
        (True, NONE),
    ],
)
def test_numbers_in_words(value, text):
    assert number(value) == text


@given(st.floats(-1e300, 1e300))
def test_a_number_in_words_is_short_and_close(value):
    text = number(value)
    assert len(text) <= 14
    plain = text.translate(str.maketrans("−⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")).replace(" ", "")
    mantissa, _, exponent = plain.partition("×10")
    # Rounding to three significant digits errs by half a unit of the third.
    assert float(f"{mantissa}e{exponent or 0}") == pytest.approx(value, rel=5.1e-3, abs=0.0)


def test_durations_and_changes_in_words():
    assert [seconds(value) for value in (0.0123, 1.0, 59.94, 61, 7260, None, -1.0)] == [
        "12 ms",
        "1.0 s",
        "59.9 s",
        "1 min 01 s",
        "2 h 01 min",
        NONE,
        NONE,
    ]
    assert change(0.4, 0.1) == "75 % less"
    assert change(0.4, 0.5) == "25 % more"
    assert change(0.1, 0.5) == "5.0 times as much"
    assert change(0.1, 0.1) == "unchanged"
    assert change(0.0, 1.0) == change(None, 1.0) == ""


@given(
    low=st.floats(1e-6, 1e6),
    factor=st.floats(1.01, 1e8),
    scale=st.sampled_from(["linear", "log"]),
    about=st.integers(3, 8),
)
def test_ticks_are_few_lie_within_and_go_up(low, factor, scale, about):
    axis = Axis(low, low * factor, 0.0, 100.0, scale)
    ticks = axis.ticks(about)
    assert 0 < len(ticks) <= 3 * about
    assert ticks == sorted(ticks)
    places = [axis.place(tick) for tick in ticks]
    assert all(0.0 <= place <= 100.0 for place in places)
    assert axis.place(low) == 0.0
    assert axis.place(low * factor) == 100.0


def test_an_axis_holds_its_values_and_keeps_the_rest_at_its_ends():
    axis = axis_around([2.0, 8.0], 0.0, 10.0)
    assert axis.low == 0.0
    assert axis.high > 8.0
    assert axis.place(-5.0) == 0.0
    assert axis.place(1e9) == 10.0
    assert axis_around([3.0, 3.0], 0.0, 10.0, "log").place(3.0) == pytest.approx(5.0, abs=0.01)
    assert axis_around([0.0, 0.0], 0.0, 10.0).high == 1.0


def test_the_tone_curve_keeps_black_and_grey_and_never_exceeds_white():
    assert not tone_curve(np.zeros((1, 1, 3))).any()
    # Below the shoulder, the curve subtracts 0.04 from grey and does nothing else (Khronos PBR Neutral,
    # 2024).
    np.testing.assert_allclose(tone_curve(np.full((1, 1, 3), 0.5)), 0.46)
    ramp = tone_curve(np.geomspace(1e-4, 1e6, 300)[:, None] * np.ones(3))
    assert (np.diff(ramp[:, 0]) >= 0.0).all()
    assert ramp.max() <= 1.0


def test_the_tone_curve_is_the_runtimes(gl_context):
    """Twin: shaders/display/tone_mapping.comp. Rounding may differ by one of 255 steps."""
    from pathlib import Path

    from vpltune.renderer.frame.runtime import Runtime
    from vpltune.renderer.scene.files import read_scene

    scene = Path(__file__).resolve().parents[3] / "configs" / "scenes" / "cornell-box.glb"
    runtime = Runtime(read_scene(scene), context=gl_context)
    linear = np.random.default_rng(0).lognormal(-1.0, 2.0, (48, 64, 3)).astype(np.float32)
    for exposure in (0.1, 1.0, 30.0):
        drawn = runtime.display(linear, exposure).astype(int)
        assert np.abs(drawn - display_image(linear, exposure)).max() <= 1


def test_signed_error_has_the_sign_of_the_error_and_the_scale_of_relmse():
    random = np.random.default_rng(0)
    reference = np.repeat(random.random((20, 30, 1)), 3, axis=2)
    valid = random.random((20, 30)) < 0.8
    darker, brighter = (signed_error(reference * factor, reference, valid) for factor in (0.5, 1.5))
    assert (darker[valid] < 0.0).all()
    assert (brighter[valid] > 0.0).all()
    assert not darker[~valid].any()
    grey = random.random((20, 30, 1)) * np.ones(3)
    error = signed_error(grey, reference, valid)[valid]
    # In grey images, luminance equals each channel, so the mean square is relMSE itself.
    assert np.mean(error**2) == pytest.approx(relmse(grey[valid], reference[valid]), rel=1e-9)


def test_signed_error_without_light_is_none_or_all():
    black, valid = np.zeros((2, 2, 3)), np.ones((2, 2), bool)
    assert not signed_error(black, black, valid).any()
    assert np.isposinf(signed_error(black + 1.0, black, valid)).all()
    assert not signed_error(black + 1.0, black, ~valid).any()


def test_a_map_has_the_colours_of_its_legend_and_is_transparent_where_nothing_is():
    values = np.array([[-9.0, -1.0, 0.0, 1.0, np.inf, 0.0]])
    valid = np.array([[True, True, True, True, True, False]])
    with Image.open(io.BytesIO(map_png(values, -1.0, 1.0, DIVERGING, valid))) as image:
        pixels = np.asarray(image.convert("RGBA"))[0]
    shown = ["#" + "".join(f"{channel:02x}" for channel in pixel[:3]) for pixel in pixels[:5]]
    assert shown == [DIVERGING[0], DIVERGING[0], DIVERGING[5], DIVERGING[-1], DIVERGING[-1]]
    assert pixels[:, 3].tolist() == [255] * 5 + [0]


def test_magma_is_even_in_lightness():
    luminances = [
        sum(
            weight * int(colour[i : i + 2], 16)
            for weight, i in zip((0.2126, 0.7152, 0.0722), (1, 3, 5), strict=True)
        )
        for colour in MAGMA
    ]
    assert luminances == sorted(luminances)


def test_the_flip_map_has_hdr_flip_as_its_mean():
    random = np.random.default_rng(0)
    reference = random.lognormal(0.0, 1.5, (24, 32, 3)).astype(np.float32)
    image = (reference * random.uniform(0.5, 1.5, (24, 32, 1))).astype(np.float32)
    errors = hdr_flip_map(image, reference)
    assert errors.shape == (24, 32)
    assert hdr_flip(image, reference) == pytest.approx(float(errors.mean()), rel=1e-6)
    assert not hdr_flip_map(0.0 * image, 0.0 * reference).any()
    assert (hdr_flip_map(image, 0.0 * reference) == 1.0).all()


def test_a_loss_curve_goes_down_the_page_as_the_loss_falls():
    chart = loss_chart({"curve": [1.0, 0.5, None, 0.25, 0.3]})
    heights = [y for _, y in chart.line]
    assert len(chart.line) == 4
    assert heights[0] < heights[1] < heights[2] > heights[3]
    assert "0.25 at step 3 of 4" in chart.description
    for empty in ({}, {"curve": None}, {"curve": [1.0]}, {"curve": "falling"}, {"curve": [math.nan, 1.0]}):
        assert loss_chart(empty) is None
    assert loss_chart({"curve": [0.0, 0.0]}) is not None


def test_a_front_is_drawn_from_fast_to_slow_with_ceiling_and_budget():
    front = [
        {"milliseconds": 8.0, "relmse": 0.1},
        {"milliseconds": 1.0, "relmse": 0.5},
        {"milliseconds": None, "relmse": 0.5},
        {"relmse": 0.2},
    ]
    chart = pareto_chart(front, 0.05, 4.0)
    assert len(chart.line) == 2
    assert chart.line[0][0] < chart.line[1][0]
    assert chart.line[0][1] < chart.line[1][1] < chart.levels[0][0]
    assert [mark.label for mark in chart.marks] == ["budget 4 ms"]
    assert pareto_chart([], 0.05, None) is None


def test_bars_are_as_wide_as_their_share_of_the_greatest():
    chart = bar_chart({"finite_n": 2.0, "none": None, "c": 1.0})
    assert chart.zero == 0.0
    assert [(bar.label, bar.left, bar.width) for bar in chart.bars] == [
        ("finite N", 0.0, 1.0),
        ("c", 0.0, 0.5),
    ]
    assert bar_chart({}) is None
    assert bar_chart({"zero": 0.0}).bars[0].width == 0.0


def test_a_negative_share_goes_the_other_way():
    chart = bar_chart({"up": 3.0, "down": -1.0})
    assert chart.zero == 0.25
    assert [(bar.left, bar.width, bar.negative) for bar in chart.bars] == [
        (0.25, 0.75, False),
        (0.0, 0.25, True),
    ]
    down = bar_chart({"down": -2.0})
    assert (down.zero, down.bars[0].left, down.bars[0].width) == (1.0, 0.0, 1.0)


def test_every_parameter_has_a_row_with_its_place_in_its_range():
    rows = parameter_rows(ArtistParameters().as_dict(), {})
    assert [row.name for row in rows] == [spec.name for spec in ARTIST_PARAMETERS]
    for row in rows:
        assert row.bar.value == row.bar.default
        assert 0.0 < row.bar.value < BAR_WIDTH
        assert row.bar.interval is None


def test_uncertainty_is_an_interval_a_source_and_what_it_trades_with():
    doubt = {
        "intensity": {"low": 0.5, "high": 2.0, "determined": True, "trades_with": []},
        "falloff_footprint": {"low": 0.05, "high": 20.0, "determined": False, "trades_with": ["intensity"]},
        "extinction_coefficient": {"low": None, "high": 2.0},
    }
    rows = {row.name: row for row in parameter_rows(ArtistParameters().as_dict(), doubt)}
    left, width = rows["intensity"].bar.interval
    assert left < rows["intensity"].bar.value < left + width
    # The interval is the whole range, so it spans the bar from end to end.
    assert rows["falloff_footprint"].bar.interval == (5.0, BAR_WIDTH - 10.0)
    assert rows["intensity"].source == "the scene"
    assert rows["falloff_footprint"].source == "the prior"
    assert rows["falloff_footprint"].trades_with == "intensity"
    assert rows["extinction_coefficient"].bar.interval is None


def test_parameters_of_another_version_are_told_as_they_are():
    rows = parameter_rows({"intensity": None, "swagger": 2.0}, {})
    assert [(row.name, row.value) for row in rows] == [("intensity", NONE), ("swagger", "2")]
    assert rows[0].bar is None
    assert rows[1].source == "unknown to this version"
