"""Scales, numbers, colours, angles and the binary message, run in the browser."""

import json
import math
import struct

import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS


def range_of(spec):
    return {"low": spec.low, "high": spec.high, "scale": spec.scale, "whole": spec.whole_number}


@pytest.mark.parametrize("spec", ARTIST_PARAMETERS, ids=lambda spec: spec.name)
def test_a_slider_has_the_places_of_the_parameter_table(run_module, spec):
    places = np.linspace(0.0, 1.0, 7)
    given = [range_of(spec), places.tolist()]
    values = run_module(
        "maths/scales.js", "return given[1].map((place) => m.valueAt(given[0], place))", given
    )
    expected = [spec.within(place) for place in places]
    # Values are rounded to four digits, or to whole numbers.
    tolerance = {"abs": 0.5} if spec.whole_number else {"rel": 1e-3, "abs": 1e-12}
    assert values == pytest.approx(expected, **tolerance)
    assert (values[0], values[-1]) == (spec.low, spec.high)
    for value in values:
        spec.checked(value)
        place = run_module("maths/scales.js", "return m.placeOf(...given)", [range_of(spec), value])
        assert place == pytest.approx(spec.place_of(value), abs=1e-9)


def test_a_step_always_moves_a_whole_number(run_module):
    count = {"low": 1, "high": 65536, "scale": "log", "whole": True}
    step = "return m.stepped(...given)"
    assert run_module("maths/scales.js", step, [count, 1, 1, False]) == 2
    assert run_module("maths/scales.js", step, [count, 512, 1, True]) == 513
    assert run_module("maths/scales.js", step, [count, 512, 1, False]) > 560
    assert run_module("maths/scales.js", step, [count, 1, -1, False]) == 1


def test_a_wide_quality_range_is_logarithmic_and_may_begin_at_zero(run_module):
    found = run_module("maths/scales.js", "return m.rangeOfBounds(0, 10000)")
    assert found["scale"] == "log_from_zero"
    values = run_module(
        "maths/scales.js", "return [0, 0.5, 1].map((place) => m.valueAt(m.rangeOfBounds(0, 10000), place))"
    )
    assert values == [0, 99, 10000]  # √10001 − 1 in the middle
    assert run_module("maths/scales.js", "return m.rangeOfBounds(4, 64).scale") == "linear"


def test_numbers_are_read_and_written_as_people_do(run_module):
    read = "return given.map((text) => m.typedNumber(text))"
    assert run_module("maths/scales.js", read, ["1,5", " 2e-3 ", "−4", "", "two", "1/0"]) == [
        1.5,
        0.002,
        -4,
        None,
        None,
        None,
    ]
    write = "return given.map((value) => m.formatted(value))"
    assert run_module("maths/scales.js", write, [0, 1, 0.0005, 1.60000001, 65536, 1e-7]) == [
        "0",
        "1",
        "0.0005",
        "1.6",
        "65536",
        "1.00e-7",
    ]


def test_a_colour_is_srgb_and_a_strength_is_linear(run_module):
    half = run_module("maths/light_values.js", "return m.colourOf([8, 4, 0])")
    # 0.5 is 0.7354 in sRGB (IEC 61966-2-1), 187.5 of 255.
    assert half == {"hex": "#ffbc00", "strength": 8}
    back = run_module("maths/light_values.js", "return m.intensityOf('#ffbc00', 8)")
    assert back == pytest.approx([8, 4, 0], abs=8 * 0.5 / 255 * 2.2)  # half a byte, by the slope at the top
    assert run_module("maths/light_values.js", "return m.intensityOf('#000000', 3)") == [3, 3, 3]
    assert run_module("maths/light_values.js", "return m.colourOf([0, 0, 0])") == {
        "hex": "#ffffff",
        "strength": 0,
    }


def test_degrees_and_directions_are_inverse(run_module):
    for azimuth, elevation in ((0, 0), (90, 30), (-135, -60), (179, 89)):
        found = run_module(
            "maths/light_values.js", "return m.degreesOf(m.directionOf(...given))", [azimuth, elevation]
        )
        assert found == pytest.approx({"azimuth": azimuth, "elevation": elevation}, abs=1e-9)
    assert run_module("maths/light_values.js", "return m.directionOf(90, 0)") == pytest.approx(
        [1, 0, 0], abs=1e-15
    )


def test_an_image_message_is_its_header_and_its_bytes(run_module):
    header = {"pane": "a", "look": 3, "source": "µ"}
    text = json.dumps(header, ensure_ascii=False).encode()
    message = list(struct.pack("<I", len(text)) + text + b"\x89PNG")
    body = """
      const { header, bytes } = m.parsedImage(new Uint8Array(given).buffer);
      return [header, [...bytes], m.mediaType(bytes)];
    """
    assert run_module("maths/image_message.js", body, message) == [header, list(b"\x89PNG"), "image/png"]
    with pytest.raises(Exception, match="header of 200 bytes in 6"):
        run_module("maths/image_message.js", body, [200, 0, 0, 0, 123, 125])


def test_images_are_shown_newest_first(run_module):
    body = "const f = new m.Freshness(); return given.map(([look, arrival]) => f.accepts(look, arrival));"
    # Decoding may end in another order than images came in.
    arrivals = [[2, 1], [1, 2], [2, 4], [2, 3], [3, 5]]
    assert run_module("maths/image_message.js", body, arrivals) == [True, False, True, False, True]


def test_a_loss_curve_is_logarithmic(run_module):
    points = run_module("maths/plots.js", "return m.lossPoints([100, 10, 0, 1], 30, 10)")
    assert points == "0.0,0.0 10.0,5.0 30.0,10.0"  # a loss of 0 has no logarithm and is left out
    assert run_module("maths/plots.js", "return m.lossPoints([], 30, 10)") == ""


def test_the_bar_of_passes_leaves_room_for_the_budget(run_module):
    bar = run_module("maths/plots.js", "return m.passBar([['gather', 3], ['resolve', 1]], 10)")
    assert [part["share"] for part in bar["parts"]] == pytest.approx([3 / 10.5, 1 / 10.5])
    assert bar["budget"] == pytest.approx(10 / 10.5)
    assert bar["total"] == 4
    over = run_module("maths/plots.js", "return m.passBar([['gather', 3], ['resolve', 1]], 2)")
    assert sum(part["share"] for part in over["parts"]) == pytest.approx(1.0)
    assert over["budget"] == 0.5


def test_names_are_words(run_module):
    names = ["falloff_footprint", "vpl_count", "rsm_resolution", "virtual_point_lights"]
    assert run_module("maths/words.js", "return given.map((name) => m.humanised(name))", names) == [
        "falloff footprint",
        "VPL count",
        "RSM resolution",
        "virtual point lights",
    ]
    assert run_module("maths/words.js", "return [m.timeLeft(59.2), m.timeLeft(3661)]") == [
        "1 min 0 s left",
        "1 h 1 min left",
    ]


def test_a_new_spot_looks_along_the_camera(run_module):
    camera = {"to_world": [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1], "yfov": 1}
    spot = run_module("maths/light_values.js", "return m.newLight('spot', given, 2)", camera)
    assert spot["position"] == [1, 2, 3]
    assert spot["direction"] == pytest.approx([0, 0, -1])
    assert spot["intensity"] == [12, 12, 12]  # 3 W/m² at 2 units
    assert 0 <= spot["inner_cone"] < spot["outer_cone"] <= math.pi / 2


@pytest.mark.parametrize("first", ["state", "scene"])
def test_listeners_are_called_once_in_the_order_in_which_they_came(run_module, first):
    """What makes rows comes before what fills them: where the state was told first, they stayed empty."""
    body = """
      const model = new m.Model();
      const called = [];
      model.on(["scene"], () => called.push("make"));
      model.on(["scene", "state"], () => called.push("fill"));
      model.on(["timings"], () => called.push("other"));
      model.changed(given);
      model.changed("scene", "state");
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
      return called;
    """
    assert run_module("talk/model.js", body, first) == ["make", "fill"]
