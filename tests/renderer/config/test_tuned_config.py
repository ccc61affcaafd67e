"""The config file: what is read, what is refused, and that both ends agree."""

import json
import math
import re
from importlib.resources import files

import jsonschema
import pytest
from config_documents import any_document, document, plain_parameters, text_with
from hypothesis import given, settings
from hypothesis import strategies as st

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.config.config_schema import config_schema
from vpltune.renderer.config.light_settings import ONE_BOUNCE, LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import (
    FitNote,
    TunedConfig,
    config_text,
    parse_config,
    read_config,
    write_config,
)
from vpltune.renderer.errors import InputError

SCHEMA = jsonschema.Draft202012Validator(config_schema())


@given(document=any_document())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_what_is_written_reads_back_equal_and_meets_the_schema(document):
    """And every value of the file is in what is written again, empty parts aside."""
    SCHEMA.validate(document)
    config = parse_config(json.dumps(document), "text")
    text = config_text(config)
    assert parse_config(text, "text") == config
    assert config_text(parse_config(text, "text")) == text
    written = json.loads(text)
    SCHEMA.validate(written)
    for part, value in document.items():
        if isinstance(value, dict):
            assert {name: written.get(part, {}).get(name, "absent") for name in value} == value, part
        else:
            assert written[part] == value, part


def test_default_is_the_tables_defaults():
    assert read_config("default") == TunedConfig()


def test_the_shortest_file_is_the_default():
    """Everything but the parameters may be left out, and so may every member of the quality part.

    But for the light: a file that says nothing of it is of one bounce.
    """
    SCHEMA.validate(document())
    default = TunedConfig(light=ONE_BOUNCE)
    assert parse_config(json.dumps(document()), "text") == default
    assert parse_config(json.dumps(document(quality={}, light={})), "text") == default


def test_a_config_goes_through_a_file(tmp_path):
    config = TunedConfig(
        ArtistParameters(intensity=1.25, lloyd_iterations=8),
        {"scene": "box.glb", "seed": 7},
        "transmittance",
        quality=Quality(interleave=4, rsm_resolution=256),
        fit=FitNote("kept", "the start was as good"),
        light=LightSettings("all"),
    )
    write_config(tmp_path / "tuned.json", config)
    assert read_config(tmp_path / "tuned.json") == config


def test_lloyd_iterations_stand_in_the_quality_part():
    written = json.loads(config_text(TunedConfig(ArtistParameters(lloyd_iterations=8))))
    assert written["quality"]["lloyd_iterations"] == 8
    assert "lloyd_iterations" not in written["parameters"]
    assert parse_config(json.dumps(written), "text").parameters.lloyd_iterations == 8
    moved = document(parameters=plain_parameters(lloyd_iterations=8))
    with pytest.raises(
        InputError, match="parameters: unknown key 'lloyd_iterations'; it belongs in 'quality'"
    ):
        parse_config(json.dumps(moved), "text")


@pytest.mark.parametrize("bounces", [1, 2, 64, "all", 3.0])
def test_bounces_are_read_and_written(bounces):
    config = parse_config(json.dumps(document(light={"bounces": bounces})), "text")
    assert config.light == LightSettings(int(bounces) if bounces != "all" else "all")
    assert parse_config(config_text(config), "text").light == config.light


@pytest.mark.parametrize("name", ["default", "auto"])
def test_presets_have_all_bounces(name):
    assert read_config(name).light == LightSettings("all") == LightSettings()


@pytest.mark.parametrize("light", [None, {}, {"sky_lights": 8}])
def test_a_file_that_says_no_bounces_has_one(light):
    said = {} if light is None else {"light": light}
    assert parse_config(json.dumps(document(**said)), "text").light.bounces == 1


def test_the_light_is_always_written_and_an_empty_provenance_is_not():
    config = parse_config(json.dumps(document(provenance={})), "text")
    written = json.loads(config_text(config))
    assert written["light"] == {"bounces": 1, "sky_lights": 32}
    assert not {"provenance", "fit", "auto"} & set(written)


@pytest.mark.parametrize(
    ("light", "said"),
    [
        ({"bounces": 0}, 'light.bounces: must be "all" or a whole number from 1 to 64, got 0'),
        ({"bounces": 65}, "light.bounces: must be"),
        ({"bounces": 1.5}, "light.bounces: must be"),
        ({"bounces": True}, "light.bounces: must be"),
        ({"bounces": "some"}, "light.bounces: must be"),
        ({"bounces": [1]}, "light.bounces: must be"),
        ({"bounce": 1}, "light: unknown key 'bounce'; known are bounces, sky_lights"),
        ([], "light: must be an object, got list"),
    ],
)
def test_light_settings_out_of_range_are_refused(light, said):
    with pytest.raises(InputError, match=re.escape(f"text: {said}")):
        parse_config(json.dumps(document(light=light)), "text")


def test_a_fit_note_may_be_without_a_sentence():
    config = parse_config(json.dumps(document(fit={"status": "improved"})), "text")
    assert config.fit == FitNote("improved")
    assert parse_config(config_text(config), "text") == config


def test_with_parameters_replaces_parameters_and_prior_alone():
    config = read_config("auto")
    changed = config.with_parameters(ArtistParameters(intensity=2.0))
    assert changed.parameters == ArtistParameters(intensity=2.0)
    assert changed.auto is None
    assert (changed.quality, changed.visibility) == (config.quality, config.visibility)
    assert changed.provenance == config.provenance


def test_configs_that_draw_alike():
    """Parameters, visibility, prior, quality and light decide an image; nothing else in the file does."""
    config = TunedConfig()
    said = TunedConfig(provenance={"seed": 1}, fit=FitNote("kept"))
    assert config.draws_as(said)
    for other in (
        TunedConfig(ArtistParameters(intensity=2.0)),
        TunedConfig(visibility="transmittance"),
        TunedConfig(quality=Quality(interleave=2)),
        TunedConfig(light=LightSettings(2)),
        TunedConfig(ArtistParameters(lloyd_iterations=0)),
        read_config("auto"),
    ):
        assert not config.draws_as(other)


def test_a_full_gather_changes_the_interleaving_alone():
    quality = Quality(interleave=8, map_size=12, rsm_resolution=128, adaptation_frames=0.0)
    config = TunedConfig(ArtistParameters(vpl_count=7), visibility="transmittance", quality=quality)
    full = config.with_full_gather()
    assert full.quality == Quality(interleave=1, map_size=12, rsm_resolution=128, adaptation_frames=0.0)
    assert (full.parameters, full.visibility) == (config.parameters, config.visibility)


def test_an_out_of_range_config_is_not_written(tmp_path):
    for config, message in (
        (TunedConfig(ArtistParameters(intensity=-1.0)), "parameters.intensity: must be"),
        (TunedConfig(ArtistParameters(lloyd_iterations=17)), "quality.lloyd_iterations: must be"),
        (TunedConfig(provenance={"seconds": math.inf}), "provenance.'seconds' must be"),
    ):
        with pytest.raises(InputError, match=message):
            write_config(tmp_path / "tuned.json", config)
    assert not list(tmp_path.iterdir())


def test_the_committed_schema_is_the_tables():
    committed = json.loads(
        files("vpltune.configs").joinpath("tuned_config.schema.json").read_text(encoding="utf-8")
    )
    assert committed == config_schema()
    jsonschema.Draft202012Validator.check_schema(committed)


@pytest.mark.parametrize("name", ["default", "auto"])
def test_the_committed_presets_are_as_they_would_be_written(name):
    text = files("vpltune.configs").joinpath(f"{name}.json").read_text(encoding="utf-8")
    assert config_text(read_config(name)) == text
    SCHEMA.validate(json.loads(text))


REFUSED = {
    "not an object": ("[1]", "must be a JSON object, got list"),
    "not JSON": ("{", "not JSON"),
    "empty": ("", "not JSON"),
    "deep": ("[" * 100_000, "not JSON"),
    "no format": (json.dumps({"version": 2, "parameters": {}}), "key 'format' is missing"),
    "no version": (json.dumps({"format": "vpltune", "parameters": {}}), "key 'version' is missing"),
    "no parameters": (json.dumps({"format": "vpltune", "version": 2}), "key 'parameters' is missing"),
    "other format": (json.dumps(document(format="gltf")), "key 'format' must be 'vpltune', got 'gltf'"),
    "future": (json.dumps(document(version=3)), "key 'version' is 3, this program reads up to 2"),
    "far future": (json.dumps(document(version=10**400)), "key 'version' is 1000"),
    "version 0": (json.dumps(document(version=0)), "key 'version' must be a whole number from 1, got 0"),
    "version -1": (json.dumps(document(version=-1)), "key 'version' must be a whole number from 1, got -1"),
    "version true": (json.dumps(document(version=True)), "'version' must be a whole number"),
    "version 2.0": (json.dumps(document(version=2.0)), "'version' must be a whole number"),
    "version '2'": (json.dumps(document(version="2")), "'version' must be a whole number"),
    "extra key": (json.dumps(document(notes="")), "unknown key 'notes'; known are format, version"),
    "parameters a list": (json.dumps(document(parameters=[])), "'parameters' must be an object, got list"),
    "quality a list": (json.dumps(document(quality=[])), "'quality' must be an object, got list"),
    "light a list": (json.dumps(document(light=[])), "light: must be an object, got list"),
    "fit a string": (json.dumps(document(fit="kept")), "'fit' must be an object, got str"),
    "fit null": (json.dumps(document(fit=None)), "'fit' must be an object, got NoneType"),
    "NaN": (text_with("parameters", "intensity", "NaN"), "parameters.intensity: must be .* got nan"),
    "1e999": (text_with("parameters", "intensity", "1e999"), "parameters.intensity: must be .* got inf"),
    "huge integer": (
        text_with("parameters", "intensity", "1" + "0" * 400),
        "parameters.intensity: must be .* got 1000",
    ),
    "5000 digits": (text_with("parameters", "intensity", "1" * 5000), "not JSON"),
    "negative": (text_with("parameters", "falloff_footprint", "-1"), "from 0.05 to 20, got -1"),
    "string": (
        text_with("parameters", "intensity", '"1"'),
        "parameters.intensity: must be a number, got '1'",
    ),
    "twice": (
        '{"format": "vpltune", "format": "vpltune", "version": 2, "parameters": {}}',
        "key 'format' appears twice",
    ),
    "parameter twice": (
        '{"format": "vpltune", "version": 2, "parameters": {"intensity": 1, "intensity": 2}}',
        "key 'intensity' appears twice",
    ),
    "unknown parameter": (
        json.dumps(document(parameters=plain_parameters(radius=1))),
        "unknown key 'radius'",
    ),
    "missing parameter": (
        json.dumps(document(parameters={"intensity": 1})),
        "'falloff_footprint' is missing",
    ),
    "a name of version 1": (
        json.dumps(document(parameters=plain_parameters(falloff_transmittance=0.0))),
        "unknown key 'falloff_transmittance'",
    ),
    "a mode of version 1": (
        json.dumps(document(visibility="none")),
        "key 'visibility' must be one of transmittance, maps, got 'none'",
    ),
    "visibility a list": (json.dumps(document(visibility=["maps"])), "'visibility' must be one of"),
    "unknown quality": (
        json.dumps(document(quality={"samples": 1})),
        "quality: unknown key 'samples'; known are interleave, .*, lloyd_iterations",
    ),
    "fit without a status": (json.dumps(document(fit={})), "fit: key 'status' is missing"),
    "fit with more": (json.dumps(document(fit={"status": "", "loss": 1})), "fit: unknown key 'loss'"),
    "fit a number": (json.dumps(document(fit={"status": 1})), "fit.status: must be a string, got 1"),
    "sentence null": (
        json.dumps(document(fit={"status": "", "sentence": None})),
        "fit.sentence: must be a string, got None",
    ),
    "provenance a list": (json.dumps(document(provenance=[])), "'provenance' must be an object"),
    "provenance nested": (json.dumps(document(provenance={"a": {}})), "provenance.'a' must be a string or"),
    "provenance NaN": ('{"provenance": {"a": NaN}, ' + json.dumps(document())[1:], "provenance.'a' must be"),
    "lloyd iterations": (text_with("quality", "lloyd_iterations", "17"), "quality.lloyd_iterations: must be"),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_refusals_are_one_line_that_names_the_file(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as refusal:
        read_config(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


def _beyond(low: float, high: float, step: float) -> tuple[str, ...]:
    """Literals that are no number of the range, or none at all."""
    return ("NaN", "1e999", "-1e999", repr(low - step), repr(high + step), "true", '"1"', "null", "[]")


REFUSED_BY_BOTH = {
    "unknown parameter": (json.dumps(document(parameters=plain_parameters(radius=1))), "radius"),
    "missing parameter": (json.dumps(document(parameters={"intensity": 1})), "falloff_footprint"),
    "unknown key": (json.dumps(document(notes="")), "notes"),
    "missing key": (json.dumps({"format": "vpltune", "version": 2}), "parameters"),
    "future version": (json.dumps(document(version=3)), "version"),
    "other format": (json.dumps(document(format="gltf")), "format"),
    "visibility": (json.dumps(document(visibility="rays")), "visibility"),
    "no visibility": (json.dumps(document(visibility="none")), "visibility"),
    "provenance NaN": (json.dumps(document(provenance={"seconds": math.nan})), "seconds"),
    "provenance 1e999": (json.dumps(document(provenance={"seconds": math.inf})), "seconds"),
    "fractional count": (text_with("parameters", "vpl_count", "1.5"), "vpl_count"),
    "checksum of another kind": (json.dumps(document(checksum="md5:0")), "checksum"),
    "checksum null": (json.dumps(document(checksum=None)), "checksum"),
    "light a list": (json.dumps(document(light=[])), "light"),
    "fit status": (json.dumps(document(fit={"status": 1})), "status"),
    "fit without a status": (json.dumps(document(fit={"sentence": ""})), "status"),
    "fit with more": (json.dumps(document(fit={"status": "", "loss": 1})), "loss"),
    "unknown quality": (json.dumps(document(quality={"samples": 1})), "samples"),
    "map_size a fraction": (text_with("quality", "map_size", "24.5"), "map_size"),
    "interleave a fraction": (text_with("quality", "interleave", "1.5"), "interleave"),
    "rsm_resolution a fraction": (text_with("quality", "rsm_resolution", "64.5"), "rsm_resolution"),
    **{
        f"{spec.name} {literal}": (text_with(spec.part, spec.name, literal), spec.name)
        for spec in ARTIST_PARAMETERS
        for literal in (*_beyond(spec.low, spec.high, 1 if spec.whole_number else 0.01), "1" + "0" * 400)
    },
    **{
        f"{name} {literal}": (text_with("quality", name, literal), name)
        for name, low, high in (
            ("interleave", 1, 8),
            ("map_size", 4, 64),
            ("map_refinement", 1, 8),
            ("rsm_resolution", 64, 8192),
            ("adaptation_frames", 0.0, 1e4),
            ("budget", 0, 0),
        )
        for literal in (*_beyond(low, high, 1), "1" + "0" * 400)
    },
    **{f"{name} 3": (text_with("quality", name, "3"), name) for name in ("interleave", "map_refinement")},
}


@pytest.mark.parametrize(("text", "key"), REFUSED_BY_BOTH.values(), ids=REFUSED_BY_BOTH)
def test_schema_and_reader_refuse_the_same_and_name_the_key(text, key):
    with pytest.raises(InputError, match=key):
        parse_config(text, "text")
    refusal = jsonschema.exceptions.best_match(SCHEMA.iter_errors(json.loads(text)))
    assert refusal is not None
    assert key in (*refusal.absolute_path, *re.findall(r"'(\w+)'", refusal.message))


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-2, 70),
    st.integers(-2, 70).map(float),
    st.sampled_from([64, 512.0, 8192, 8193, 10**400, 1e999, math.nan, -0.0, 0.5, 1e4, 10_001, "1", [], {}]),
    st.floats(),
)


@given(
    quality=st.dictionaries(
        st.sampled_from([*Quality.__dataclass_fields__, "lloyd_iterations", "extra"]), VALUES, max_size=3
    ),
)
@settings(max_examples=500, deadline=None, derandomize=True)
def test_schema_and_reader_agree_on_the_quality_part(quality):
    """Whatever stands there; what both accept has the value that the file says."""
    text = json.dumps(document(quality=quality))
    try:
        config = parse_config(text, "text")
    except InputError:
        assert not SCHEMA.is_valid(json.loads(text)), quality
    else:
        SCHEMA.validate(json.loads(text))
        read = {**config.quality.as_dict(), "lloyd_iterations": config.parameters.lloyd_iterations}
        assert {name: read[name] for name in quality} == quality


@given(data=st.data())
@settings(max_examples=200, deadline=None, derandomize=True)
def test_schema_and_reader_agree_on_a_budget(data):
    """A right one with one member left out, replaced or added."""
    budget: dict = {"milliseconds": 2.0, "frame_size": [640, 480], "machine": ""}
    name = data.draw(st.sampled_from([*budget, "extra"]))
    value = data.draw(VALUES | st.lists(VALUES, max_size=3) | st.just("left out"))
    if value == "left out":
        budget.pop(name, None)
    else:
        budget[name] = value
    text = json.dumps(document(quality={"budget": budget}))
    try:
        config = parse_config(text, "text")
    except InputError:
        assert not SCHEMA.is_valid(json.loads(text)), budget
    else:
        SCHEMA.validate(json.loads(text))
        assert config.quality.as_dict()["budget"] == budget


def test_whole_numbers_written_as_fractions_are_taken():
    """JSON has one kind of number: 24.0 is 24."""
    quality = {"interleave": 4.0, "map_size": 12.0, "map_refinement": 2.0, "rsm_resolution": 256.0}
    budget = {"milliseconds": 4, "frame_size": [640.0, 480.0], "machine": "llvmpipe"}
    text = json.dumps(document(quality={**quality, "budget": budget, "lloyd_iterations": 2.0}))
    SCHEMA.validate(json.loads(text))
    config = parse_config(text, "text")
    assert config.quality.as_dict() == {**quality, "adaptation_frames": 15.0, "budget": budget}
    whole = (config.quality.interleave, config.quality.map_size, config.quality.rsm_resolution)
    assert all(isinstance(value, int) for value in (*whole, config.parameters.lloyd_iterations))
