"""The quality part: its rules, each with the message that says what is wrong."""

import math

import pytest

from vpltune.renderer.config.quality import (
    INTERLEAVES,
    MAP_REFINEMENTS,
    MetBudget,
    Quality,
    quality_schema,
)
from vpltune.renderer.errors import InputError

BUDGET = {"milliseconds": 4.0, "frame_size": [640, 480], "machine": "llvmpipe"}

RULES = {
    "interleave": (
        "must be one of auto, 1, 2, 4, 8",
        (0, 3, 5, 16, -1, 2.5, True, "4", "full", None, math.nan, 10**400),
    ),
    "map_size": (
        "must be a whole number from 4 to 64",
        (3, 65, 0, -4, 24.5, True, "24", None, math.inf, 10**400),
    ),
    "map_refinement": ("must be one of 1, 2, 4, 8", (0, 3, 16, 1.5, True, "4", None)),
    "rsm_resolution": (
        "must be a whole number from 64 to 8192",
        (63, 8193, 0, 64.5, True, "64", math.nan, 10**400),
    ),
    "adaptation_frames": (
        "must be a number from 0 to 10000",
        (-1e-9, -1, 10_001, math.nan, math.inf, -math.inf, True, "15", None, 10**400),
    ),
}
REFUSED = [
    (name, value, f"{name}: {message}, got ") for name, (message, values) in RULES.items() for value in values
]


@pytest.mark.parametrize(("name", "value", "message"), REFUSED)
def test_every_rule_of_a_file(name, value, message):
    with pytest.raises(InputError) as refusal:
        Quality.validated({name: value}, "tuned.json: quality")
    assert str(refusal.value).startswith(f"tuned.json: quality.{message}")
    assert len(str(refusal.value)) < 160
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        # Values of another type do not get that far in a test: annotations are checked.
        (name, value, message)
        for name, value, message in REFUSED
        if type(value) is (float if name == "adaptation_frames" else int)
    ],
)
def test_every_rule_of_an_object(name, value, message):
    with pytest.raises(InputError) as refusal:
        Quality(**{name: value})
    assert str(refusal.value).startswith(f"quality.{message}")


def test_a_resolution_that_is_left_out_is_no_resolution_that_is_null():
    assert Quality.validated({}, "quality").rsm_resolution is None
    with pytest.raises(InputError, match="quality.rsm_resolution: must be a whole number .*, got None"):
        Quality.validated({"rsm_resolution": None}, "quality")


def test_bounds_are_allowed():
    for name, values in {
        "interleave": ("auto", *INTERLEAVES),
        "map_size": (4, 64),
        "map_refinement": MAP_REFINEMENTS,
        "rsm_resolution": (64, 8192),
        "adaptation_frames": (0.0, 1e4),
    }.items():
        for value in values:
            assert getattr(Quality(**{name: value}), name) == value
            assert getattr(Quality.validated({name: value}, "quality"), name) == value


@pytest.mark.parametrize("values", [None, [], "4", 4, True])
def test_what_is_no_object_is_refused(values):
    with pytest.raises(
        InputError, match=f"^tuned.json: quality: must be an object, got {type(values).__name__}"
    ):
        Quality.validated(values, "tuned.json: quality")
    with pytest.raises(InputError, match="quality.budget: must be an object, got"):
        Quality.validated({"budget": values}, "quality")


def test_unknown_keys_are_named_beside_the_known_ones():
    with pytest.raises(InputError) as refusal:
        Quality.validated({"samples": 1}, "quality", ("lloyd_iterations",))
    assert str(refusal.value) == (
        "quality: unknown key 'samples'; known are interleave, map_size, map_refinement, rsm_resolution, "
        "adaptation_frames, budget, lloyd_iterations"
    )
    with pytest.raises(InputError, match="quality.budget: unknown key 'gpu'; known are milliseconds, "):
        Quality.validated({"budget": {**BUDGET, "gpu": 1}}, "quality")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"milliseconds": 0.0}, "budget.milliseconds: must be positive, got 0.0"),
        ({"milliseconds": -0.0}, "budget.milliseconds: must be positive, got -0.0"),
        ({"milliseconds": -1}, "budget.milliseconds: must be a number from 0 to 1e+09, got -1"),
        ({"milliseconds": 2e9}, "budget.milliseconds: must be a number from 0 to 1e+09, got 2000000000.0"),
        ({"milliseconds": math.nan}, "budget.milliseconds: must be a number from 0 to 1e+09, got nan"),
        ({"milliseconds": 10**400}, "budget.milliseconds: must be a number from 0 to 1e+09, got 1000"),
        ({"milliseconds": True}, "budget.milliseconds: must be a number from 0 to 1e+09, got True"),
        ({"milliseconds": "4"}, "budget.milliseconds: must be a number from 0 to 1e+09, got '4'"),
        ({"frame_size": [640]}, "budget.frame_size: must be [width, height], got [640]"),
        ({"frame_size": [640, 480, 1]}, "budget.frame_size: must be [width, height], got [640, 480, 1]"),
        ({"frame_size": "640x480"}, "budget.frame_size: must be [width, height], got '640x480'"),
        ({"frame_size": None}, "budget.frame_size: must be [width, height], got None"),
        ({"frame_size": [0, 480]}, "budget.frame_size: must be a whole number from 1 to 16384, got 0"),
        (
            {"frame_size": [640, 16385]},
            "budget.frame_size: must be a whole number from 1 to 16384, got 16385",
        ),
        ({"frame_size": [640, 1.5]}, "budget.frame_size: must be a whole number from 1 to 16384, got 1.5"),
        ({"frame_size": [True, 480]}, "budget.frame_size: must be a whole number from 1 to 16384, got True"),
        ({"machine": 1}, "budget.machine: must be a string, got 1"),
        ({"machine": None}, "budget.machine: must be a string, got None"),
    ],
)
def test_every_rule_of_a_budget(change, message):
    with pytest.raises(InputError) as refusal:
        Quality.validated({"budget": BUDGET | change}, "quality")
    assert str(refusal.value).startswith(f"quality.{message}")


@pytest.mark.parametrize("name", BUDGET)
def test_a_budget_says_all_or_nothing(name):
    budget = {key: value for key, value in BUDGET.items() if key != name}
    with pytest.raises(InputError, match=f"^quality.budget: key '{name}' is missing"):
        Quality.validated({"budget": budget}, "quality")


def test_what_is_written_reads_back_equal():
    """What is None is not written; the frame size is a list in JSON and a pair in Python."""
    assert Quality.validated(Quality().as_dict(), "quality") == Quality()
    assert "rsm_resolution" not in Quality().as_dict() and "budget" not in Quality().as_dict()
    quality = Quality(8, 4, 1, 64, 0.0, MetBudget(4.0, (640, 480), "llvmpipe"))
    assert quality.as_dict()["budget"] == BUDGET
    assert Quality.validated(quality.as_dict(), "quality") == quality


def test_whole_numbers_may_be_written_as_fractions_and_fractions_as_whole_numbers():
    quality = Quality.validated({"interleave": 2.0, "map_size": 8.0, "adaptation_frames": 3}, "quality")
    assert quality == Quality(interleave=2, map_size=8, adaptation_frames=3.0)
    assert type(quality.map_size) is int and type(quality.adaptation_frames) is float


LARGE = (1920, 1080)
"""A frame in pixels of which `auto` takes its largest blocks."""


@pytest.mark.parametrize(("side", "largest"), [(8, 8), ("auto", 4)])
def test_blocks_are_no_larger_than_vpls_go_round(side, largest):
    asked = Quality(interleave=side)
    expected = [min(largest, by_count) for by_count in (1, 1, 1, 2, 2, 4, 4, 8, 8)]
    assert [asked.interleave_for(n, LARGE) for n in (0, 1, 3, 4, 15, 16, 63, 64, 1024)] == expected


@pytest.mark.parametrize("side", INTERLEAVES)
def test_a_side_that_is_asked_for_does_not_follow_the_frame(side):
    assert {Quality(interleave=side).interleave_for(1024, size) for size in ((1, 1), (64, 48), LARGE)} == {
        side
    }


@pytest.mark.parametrize(
    ("size", "side"),
    [
        ((1, 1), 1),
        ((160, 90), 1),
        ((319, 180), 1),
        ((320, 180), 2),
        ((180, 320), 2),
        ((639, 360), 2),
        ((640, 360), 4),
        ((16384, 16384), 4),
    ],
)
def test_auto_blocks_follow_the_pixels_of_the_frame(size, side):
    assert Quality().interleave_for(512, size) == side


def test_the_schema_knows_every_member_and_its_default():
    schema = quality_schema({"type": "integer"})
    members = schema["properties"]
    assert set(members) == {*Quality.__dataclass_fields__, "lloyd_iterations"}
    for name, member in members.items():
        if "default" in member:
            assert member["default"] == getattr(Quality(), name), name
    assert {name for name, member in members.items() if "default" not in member} == {
        *("rsm_resolution", "budget", "lloyd_iterations")
    }
