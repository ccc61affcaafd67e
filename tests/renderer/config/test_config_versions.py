"""Configs of version 1 are read as version 2, and nothing else that is older or newer."""

import json
import math
from dataclasses import replace

import pytest
from config_documents import (
    OLDER_QUALITY,
    any_parameters,
    document,
    older_document,
    older_parameters,
    plain_parameters,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.config_versions import OLDER_NAMES, brought_forward
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import (
    VERSION,
    FitNote,
    TunedConfig,
    config_text,
    parse_config,
    read_config,
)
from vpltune.renderer.errors import InputError


def read(changed: dict) -> TunedConfig:
    return parse_config(json.dumps(changed), "older.json")


POINTS = TunedConfig(point_vpls(), quality=OLDER_QUALITY, light=ONE_BOUNCE)
"""What version 1 drew by default: points, of which every pixel gathers all, and one bounce."""


def test_the_shortest_older_file_is_the_default_of_version_1():
    """An older file draws what it drew; the rest of its quality is the default of today."""
    assert read(older_document()) == POINTS


def test_an_older_file_goes_through_the_file_reader(tmp_path):
    (tmp_path / "older.json").write_text(json.dumps(older_document(visibility="maps")))
    assert read_config(tmp_path / "older.json") == POINTS


def test_names_are_those_of_today():
    parameters = older_parameters(falloff_transmittance=0.75, density_relaxation=6, intensity=2.0)
    config = read(older_document(parameters=parameters, visibility="transmittance"))
    assert config.parameters == point_vpls(intensity=2.0, extinction_coefficient=0.75, lloyd_iterations=6)
    assert config.visibility == "transmittance"


def test_the_document_itself():
    """What the table of names says, each value once and in the part where it stands today."""
    older = older_document(
        parameters=older_parameters(falloff_transmittance=0.75, density_relaxation=6),
        provenance={"scene": "box.glb", "seed": 7, "status": "improved", "fit": "relMSE fell"},
    )
    kept = json.loads(json.dumps(older))
    assert brought_forward(older, "older.json") == document(
        parameters=plain_parameters(
            falloff_footprint=0.5, extinction_coefficient=0.75, vpl_count=1024, density_importance=0.0
        ),
        quality={"lloyd_iterations": 6, "interleave": 1, "map_size": 24},
        provenance={"scene": "box.glb", "seed": 7},
        fit={"status": "improved", "sentence": "relMSE fell"},
    )
    assert older == kept, "the caller's document is left as it was"


@given(values=any_parameters(), visibility=st.sampled_from(["transmittance", "maps"]))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_every_older_file_is_read_and_written_as_version_2(values, visibility):
    older = dict(values)
    for before, now in OLDER_NAMES.items():
        older[before] = older.pop(now)
    config = read(older_document(parameters=older, visibility=visibility))
    assert config == TunedConfig(
        ArtistParameters.validated(values), visibility=visibility, quality=OLDER_QUALITY, light=ONE_BOUNCE
    )
    text = config_text(config)
    assert json.loads(text)["version"] == VERSION == 2
    assert parse_config(text, "newer.json") == config


@pytest.mark.parametrize("transmittance", [0.0, 0.75, 8.0])
def test_no_visibility_is_transmittance_without_extinction(transmittance):
    """Version 1 heeded no transmittance where nothing occluded."""
    parameters = older_parameters(falloff_transmittance=transmittance, intensity=2.0)
    config = read(older_document(parameters=parameters, visibility="none"))
    assert config.visibility == "transmittance"
    assert config.parameters == point_vpls(intensity=2.0, extinction_coefficient=0.0)


def test_a_file_without_a_visibility_means_maps():
    assert read(older_document()).visibility == "maps"


@pytest.mark.parametrize("status", ["improved", "kept", "unlit", "doubtful"])
def test_the_status_of_a_fit_leaves_the_provenance(status):
    said = {"scene": "box.glb", "status": status, "fit": "a sentence", "seconds": 1.5}
    config = read(older_document(provenance=said))
    assert config.fit == FitNote(status, "a sentence")
    assert config.provenance == {"scene": "box.glb", "seconds": 1.5}


def test_a_status_without_a_sentence():
    config = read(older_document(provenance={"status": "kept"}))
    assert config.fit == FitNote("kept", "")
    assert config.provenance == {}


@pytest.mark.parametrize(
    "said", [{"status": 3}, {"status": "kept", "fit": 2.5}, {"fit": "alone"}, {"seed": 1}, {}]
)
def test_a_provenance_that_no_fit_wrote_is_kept(said):
    """Version 1 allowed any names to strings or numbers."""
    config = read(older_document(provenance=said))
    assert config.fit is None
    assert config.provenance == said


def test_a_prior_comes_along():
    prior = made_prior()
    config = read(older_document(auto=prior.as_dict(), visibility="maps"))
    assert config == replace(POINTS, auto=prior)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"notes": ""}, "unknown key 'notes'; version 1 knows format, version, visibility, parameters, auto"),
        ({"quality": {}}, "unknown key 'quality'; version 1 knows"),
        ({"fit": {"status": "kept"}}, "unknown key 'fit'; version 1 knows"),
        ({"light": {}}, "unknown key 'light'; version 1 knows"),
        ({"checksum": "sha256:" + "0" * 64}, "unknown key 'checksum'; version 1 knows"),
        ({"visibility": "rays"}, "key 'visibility' must be one of transmittance, maps, got 'rays'"),
        ({"parameters": []}, "key 'parameters' must be an object, got list"),
        ({"provenance": []}, "key 'provenance' must be an object, got list"),
        ({"provenance": {"seconds": math.nan}}, "provenance.'seconds' must be a string or a finite number"),
        ({"parameters": older_parameters(radius=1)}, "parameters: unknown key 'radius'; known are intensity"),
        ({"parameters": older_parameters(intensity=0.0)}, "parameters.intensity: must be a number from"),
        (
            {"parameters": older_parameters(falloff_transmittance=-1.0)},
            "parameters.extinction_coefficient: must be a number from 0 to 8, got -1.0",
        ),
        (
            {"parameters": older_parameters(density_relaxation=17)},
            "quality.lloyd_iterations: must be a whole number from 0 to 16, got 17",
        ),
        (
            {"parameters": older_parameters(density_relaxation=1.5)},
            "quality.lloyd_iterations: must be a whole number, got 1.5",
        ),
        (
            {"auto": made_prior().as_dict(), "visibility": "transmittance"},
            "key 'auto' goes with visibility 'maps', got 'transmittance'",
        ),
    ],
    ids=lambda value: str(list(value)) if isinstance(value, dict) else None,
)
def test_what_version_1_did_not_have_is_refused(changed, message):
    with pytest.raises(InputError, match=f"^older.json: {message}"):
        read(older_document(**changed))


@pytest.mark.parametrize("name", older_parameters())
def test_a_missing_parameter_is_named_as_version_1_called_it(name):
    parameters = older_parameters()
    del parameters[name]
    with pytest.raises(InputError, match=f"^older.json: parameters: key '{name}' is missing"):
        read(older_document(parameters=parameters))


@pytest.mark.parametrize(("before", "now"), OLDER_NAMES.items())
def test_a_name_of_today_is_unknown_to_version_1(before, now):
    """In the place of the older one and beside it: which of the two would count?"""
    beside = older_parameters(**{now: 1})
    instead = {now if name == before else name: value for name, value in older_parameters().items()}
    for parameters in (beside, instead):
        with pytest.raises(InputError, match=f"unknown key '{now}'; version 1 calls it '{before}'"):
            read(older_document(parameters=parameters))


@pytest.mark.parametrize("version", [3, 4, 2**31])
def test_later_versions_are_refused(version):
    """Whatever they hold: what they mean is not known."""
    for later in (document(version=version), older_document(version=version)):
        with pytest.raises(InputError, match=f"key 'version' is {version}, this program reads up to 2"):
            read(later)


def test_an_older_file_that_calls_itself_version_2_is_refused():
    with pytest.raises(InputError, match="parameters: unknown key 'falloff_transmittance'"):
        read(older_document(version=2))
    with pytest.raises(InputError, match="parameters: unknown key 'extinction_coefficient'"):
        read(document(version=1))
