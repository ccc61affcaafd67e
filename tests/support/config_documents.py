"""Config files as plain JSON documents, of the present version and of version 1."""

import json
from typing import Any

from hypothesis import strategies as st

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, parameter_spec
from vpltune.renderer.config.quality import INTERLEAVES, LARGEST_SIDE, MAP_REFINEMENTS, Quality
from vpltune.renderer.config.tuned_config import VISIBILITIES


def plain_parameters(**changes: Any) -> dict[str, Any]:
    """The key `parameters` with the table's defaults."""
    defaults = ArtistParameters().as_dict()
    in_file = {name: v for name, v in defaults.items() if parameter_spec(name).part == "parameters"}
    return {**in_file, **changes}


def document(**changes: Any) -> dict[str, Any]:
    """The shortest config file of version 2, of one bounce, with some keys changed or added."""
    return {"format": "vpltune", "version": 2, "parameters": plain_parameters()} | changes


OLDER_QUALITY = Quality(interleave=1, map_size=24)
"""What version 1 drew with."""


def older_document(**changes: Any) -> dict[str, Any]:
    """A config file as version 1 had it."""
    return {"format": "vpltune", "version": 1, "parameters": older_parameters()} | changes


def older_parameters(**changes: Any) -> dict[str, Any]:
    """The key `parameters` of version 1, spelt out: it does not follow the table of today."""
    return {
        "intensity": 1.0,
        "falloff_footprint": 0.5,
        "falloff_transmittance": 0.0,
        "visibility_bias": 0.0005,
        "visibility_softness": 0.001,
        "vpl_count": 1024,
        "density_exponent": 1.0,
        "density_importance": 0.0,
        "density_relaxation": 0,
        "screen_space_radius": 3.0,
        "screen_space_strength": 0.0,
    } | changes


def text_with(part: str, name: str, literal: str) -> str:
    """A short config as text, with any literal as the value of `part`.`name`."""
    values = plain_parameters() if part == "parameters" else {}
    return json.dumps(document(**{part: {**values, name: "@"}})).replace('"@"', literal)


def any_parameters() -> st.SearchStrategy[dict[str, Any]]:
    """Parameters that a file may hold, by name. Plain values: making an object draws random numbers, of which
    hypothesis must not know, for the check of its annotations."""
    values = {
        spec.name: st.integers(int(spec.low), int(spec.high))
        if spec.whole_number
        else st.floats(spec.low, spec.high)
        for spec in ARTIST_PARAMETERS
    }
    return st.fixed_dictionaries(values)


def any_quality() -> st.SearchStrategy[dict[str, Any]]:
    """A quality part that a file may hold, without `lloyd_iterations`."""
    side = st.integers(1, LARGEST_SIDE)
    budget = {
        "milliseconds": st.floats(0.0, 1e9, exclude_min=True),
        "frame_size": st.tuples(side, side).map(list),
        "machine": any_text(),
    }
    return st.fixed_dictionaries(
        {
            "interleave": st.sampled_from(("auto", *INTERLEAVES)),
            "map_size": st.integers(4, 64),
            "map_refinement": st.sampled_from(MAP_REFINEMENTS),
            "adaptation_frames": st.floats(0.0, 1e4),
        },
        optional={"rsm_resolution": st.integers(64, 8192), "budget": st.fixed_dictionaries(budget)},
    )


def any_text() -> st.SearchStrategy[str]:
    """Text of any code points, lone surrogates too: a provenance may hold a broken file name."""
    return st.text(st.characters())


def any_document() -> st.SearchStrategy[dict[str, Any]]:
    """A config file of version 2 with any values, without a prior and a checksum."""
    number = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**30), 10**30)
    fit = st.fixed_dictionaries({"status": any_text()}, optional={"sentence": any_text()})
    parts = {
        "visibility": st.sampled_from(VISIBILITIES),
        "quality": any_quality(),
        "light": st.fixed_dictionaries(
            {},
            optional={"bounces": st.just("all") | st.integers(1, 64), "sky_lights": st.integers(1, 256)},
        ),
        "fit": fit,
        "provenance": st.dictionaries(any_text(), any_text() | number, max_size=3),
    }

    def made(parameters: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
        iterations = parameters.pop("lloyd_iterations")
        quality = {**changes.get("quality", {}), "lloyd_iterations": iterations}
        return document(parameters=parameters) | changes | {"quality": quality}

    return st.builds(made, any_parameters(), st.fixed_dictionaries({}, optional=parts))
