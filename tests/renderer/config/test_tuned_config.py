"""The config file: what is read, what is refused, and that both ends agree."""

import json
import math
import re
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.config.tuned_config import (
    MAXIMUM_FILE_BYTES,
    TunedConfig,
    config_schema,
    config_text,
    parse_config,
    read_config,
    write_config,
)
from vpltune.renderer.errors import InputError


def document(**changes):
    plain = {"format": "vpltune", "version": 1, "parameters": ArtistParameters().as_dict()}
    return plain | changes


def parameters_text(name, literal):
    """The default config as text, with the number of `name` replaced by any literal."""
    values = {**ArtistParameters().as_dict(), name: "@"}
    return json.dumps(document(parameters=values)).replace('"@"', literal)


def in_range(spec):
    return st.integers(int(spec.low), int(spec.high)) if spec.whole_number else st.floats(spec.low, spec.high)


values_in_range = st.fixed_dictionaries({spec.name: in_range(spec) for spec in ARTIST_PARAMETERS})
provenances = st.dictionaries(
    st.text(st.characters()), st.text(st.characters()) | st.floats(allow_nan=False, allow_infinity=False)
)


@given(values=values_in_range, provenance=provenances)
@settings(max_examples=50, deadline=None, derandomize=True)
def test_what_is_written_reads_back_equal_and_meets_the_schema(values, provenance):
    config = TunedConfig(ArtistParameters.validated(values), provenance)
    text = config_text(config)
    assert parse_config(text, "text") == config
    jsonschema.validate(json.loads(text), config_schema())


def test_default_is_the_tables_defaults():
    assert read_config("default") == TunedConfig()


def test_a_config_goes_through_a_file(tmp_path):
    config = TunedConfig(ArtistParameters(intensity=1.25), {"scene": "box.glb", "seed": 7})
    write_config(tmp_path / "tuned.json", config)
    assert read_config(tmp_path / "tuned.json") == config


def test_an_out_of_range_config_is_not_written(tmp_path):
    with pytest.raises(InputError, match="parameters.intensity: must be"):
        write_config(tmp_path / "tuned.json", TunedConfig(ArtistParameters(intensity=-1.0)))
    assert not list(tmp_path.iterdir())


def test_the_committed_schema_is_the_tables():
    committed = json.loads(
        files("vpltune.configs").joinpath("tuned_config.schema.json").read_text(encoding="utf-8")
    )
    assert committed == config_schema()
    jsonschema.Draft202012Validator.check_schema(committed)


REFUSED = {
    "not an object": ("[1]", "must be a JSON object, got list"),
    "not JSON": ("{", "not JSON"),
    "empty": ("", "not JSON"),
    "deep": ("[" * 100_000, "not JSON"),
    "no format": (json.dumps({"version": 1, "parameters": {}}), "key 'format' is missing"),
    "no version": (json.dumps({"format": "vpltune", "parameters": {}}), "key 'version' is missing"),
    "no parameters": (json.dumps({"format": "vpltune", "version": 1}), "key 'parameters' is missing"),
    "other format": (json.dumps(document(format="gltf")), "key 'format' must be 'vpltune', got 'gltf'"),
    "future": (json.dumps(document(version=2)), "key 'version' is 2, this program reads up to 1"),
    "far future": (json.dumps(document(version=10**400)), "key 'version' is 1000"),
    "version 0": (json.dumps(document(version=0)), "key 'version' must be a whole number from 1, got 0"),
    "version true": (json.dumps(document(version=True)), "'version' must be a whole number"),
    "version 1.0": (json.dumps(document(version=1.0)), "'version' must be a whole number"),
    "extra key": (json.dumps(document(notes="")), "unknown key 'notes'; known are format, version"),
    "parameters a list": (json.dumps(document(parameters=[])), "'parameters' must be an object, got list"),
    "NaN": (parameters_text("intensity", "NaN"), "parameters.intensity: must be .* got nan"),
    "1e999": (parameters_text("intensity", "1e999"), "parameters.intensity: must be .* got inf"),
    "huge integer": (
        parameters_text("intensity", "1" + "0" * 400),
        "parameters.intensity: must be .* got 1000",
    ),
    "5000 digits": (parameters_text("intensity", "1" * 5000), "not JSON"),
    "negative": (parameters_text("falloff_footprint", "-1"), "from 0.05 to 20, got -1"),
    "string": (parameters_text("intensity", '"1"'), "parameters.intensity: must be a number, got '1'"),
    "twice": (
        '{"format": "vpltune", "format": "vpltune", "version": 1, "parameters": {}}',
        "key 'format' stands there twice",
    ),
    "parameter twice": (
        '{"format": "vpltune", "version": 1, "parameters": {"intensity": 1, "intensity": 2}}',
        "key 'intensity' stands there twice",
    ),
    "unknown parameter": (
        json.dumps(document(parameters=ArtistParameters().as_dict() | {"radius": 1})),
        "unknown key 'radius'",
    ),
    "missing parameter": (
        json.dumps(document(parameters={"intensity": 1})),
        "'falloff_footprint' is missing",
    ),
    "provenance a list": (json.dumps(document(provenance=[])), "'provenance' must be an object"),
    "provenance nested": (json.dumps(document(provenance={"a": {}})), "provenance.'a' must be a string or"),
    "provenance NaN": ('{"provenance": {"a": NaN}, ' + json.dumps(document())[1:], "provenance.'a' must be"),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_refusals_are_one_line_that_names_the_file(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as refusal:
        read_config(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


REFUSED_BY_BOTH = {
    "unknown parameter": (
        json.dumps(document(parameters=ArtistParameters().as_dict() | {"radius": 1})),
        "radius",
    ),
    "missing parameter": (json.dumps(document(parameters={"intensity": 1})), "falloff_footprint"),
    "unknown key": (json.dumps(document(notes="")), "notes"),
    "missing key": (json.dumps({"format": "vpltune", "version": 1}), "parameters"),
    "future version": (json.dumps(document(version=2)), "version"),
    "other format": (json.dumps(document(format="gltf")), "format"),
    "visibility": (json.dumps(document(visibility="rays")), "visibility"),
    "provenance NaN": (json.dumps(document(provenance={"seconds": math.nan})), "seconds"),
    "provenance 1e999": (json.dumps(document(provenance={"seconds": math.inf})), "seconds"),
    "fractional count": (parameters_text("vpl_count", "1.5"), "vpl_count"),
    "a bool": (parameters_text("intensity", "true"), "intensity"),
    **{
        f"{spec.name} {literal}": (parameters_text(spec.name, literal), spec.name)
        for spec in ARTIST_PARAMETERS
        for literal in ("NaN", "1e999", "-1e999", repr(spec.low - 0.01), repr(spec.high * 1.01))
    },
}


@pytest.mark.parametrize(("text", "key"), REFUSED_BY_BOTH.values(), ids=REFUSED_BY_BOTH)
def test_schema_and_reader_refuse_the_same_and_name_the_key(text, key):
    with pytest.raises(InputError, match=key):
        parse_config(text, "text")
    with pytest.raises(jsonschema.ValidationError) as refusal:
        jsonschema.validate(json.loads(text), config_schema())
    assert key in (*refusal.value.absolute_path, *re.findall(r"'(\w+)'", refusal.value.message))


def test_files_that_are_not_text_or_not_there(tmp_path):
    with pytest.raises(InputError, match=r"absent.json: cannot be read \(No such file"):
        read_config(tmp_path / "absent.json")
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory"):
        read_config(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_config(tmp_path / "binary.json")
    (tmp_path / "long.json").write_bytes(b" " * (MAXIMUM_FILE_BYTES + 1))
    with pytest.raises(InputError, match="this file is longer"):
        read_config(tmp_path / "long.json")


def test_a_device_without_end_is_refused():
    with pytest.raises(InputError, match="this file is longer"):
        read_config(Path("/dev/zero"))


def test_a_byte_order_mark_is_passed_over(tmp_path):
    (tmp_path / "bom.json").write_bytes(b"\xef\xbb\xbf" + config_text(TunedConfig()).encode())
    assert read_config(tmp_path / "bom.json") == TunedConfig()
