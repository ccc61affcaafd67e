"""The checksum of a config: of its values, whatever the file looks like, and refused where it is wrong."""

import json
import re

import numpy as np
import pytest
from config_documents import OLDER_QUALITY, any_document, document, older_document
from hypothesis import given, settings
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.gltf_extras import write_gltf_extras
from vpltune.renderer.config.light_settings import ONE_BOUNCE, LightSettings
from vpltune.renderer.config.quality import MetBudget, Quality
from vpltune.renderer.config.tuned_config import (
    FitNote,
    TunedConfig,
    config_text,
    parse_config,
    read_config,
    write_config,
)
from vpltune.renderer.errors import InputError

CONFIG = TunedConfig(
    ArtistParameters(intensity=1.0 / 3.0, vpl_count=77),
    {"scene": "a é\ud800", "seconds": 12.0, "seed": 7, "tiny": 1e-300, "large": 1e300, "zero": -0.0},
    auto=made_prior(),
    quality=Quality(interleave=4, budget=MetBudget(4.0, (640, 480), "llvmpipe")),
    fit=FitNote("kept", "the start was as good"),
    light=LightSettings(3),
)


def written(config: TunedConfig = CONFIG) -> dict:
    return json.loads(config_text(config))


def without_fractions_of_zero(value):
    """As JavaScript writes numbers: 12 for 12.0."""
    if isinstance(value, dict):
        return {key: without_fractions_of_zero(member) for key, member in value.items()}
    if isinstance(value, list):
        return [without_fractions_of_zero(member) for member in value]
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e21 else value


def reversed_keys(value):
    if isinstance(value, dict):
        return {key: reversed_keys(value[key]) for key in reversed(list(value))}
    return [reversed_keys(member) for member in value] if isinstance(value, list) else value


def test_every_written_file_has_one():
    assert re.fullmatch("sha256:[0-9a-f]{64}", written()["checksum"])


def test_a_file_without_a_checksum_is_read():
    plain = written()
    del plain["checksum"]
    assert parse_config(json.dumps(plain), "text") == CONFIG


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        ("parameters", "intensity", 0.34),
        ("parameters", "vpl_count", 78),
        ("quality", "interleave", 2),
        ("quality", "lloyd_iterations", 1),
        ("quality", "rsm_resolution", 512),
        ("quality", "budget", {"milliseconds": 5.0, "frame_size": [640, 480], "machine": "llvmpipe"}),
        ("auto", "bias", [0.5, 0.5, 0.5, 0.25]),
        ("fit", "status", "improved"),
        ("fit", "sentence", ""),
        ("light", "bounces", 4),
        ("light", "bounces", "all"),
        ("provenance", "seed", 8),
        ("provenance", "seed", "7"),
    ],
)
def test_any_other_value_makes_it_wrong(part, name, value):
    config = TunedConfig() if name == "lloyd_iterations" else CONFIG
    edited = written(config)
    edited[part] = {**edited[part], name: value}
    with pytest.raises(InputError, match="^text: key 'checksum' does not fit the values") as refusal:
        parse_config(json.dumps(edited), "text")
    assert str(refusal.value).endswith("vpltune export text --to json -o text --renew-checksum")
    unchecked = parse_config(json.dumps(edited), "text", check=False)
    assert unchecked != config
    renewed = config_text(unchecked)
    assert parse_config(renewed, "text") == unchecked
    assert json.loads(renewed)["checksum"] not in (edited["checksum"], "")


@pytest.mark.parametrize("part", ["visibility", "fit", "light", "provenance", "auto"])
def test_a_part_that_is_taken_away_makes_it_wrong(part):
    config = TunedConfig(visibility="transmittance") if part == "visibility" else CONFIG
    edited = written(config)
    del edited[part]
    with pytest.raises(InputError, match="key 'checksum' does not fit the values"):
        parse_config(json.dumps(edited), "text")


@pytest.mark.parametrize("checksum", ["", "sha256:", "sha256:" + "0" * 64, "md5:0", 1, None, [], {}])
def test_another_checksum_is_wrong(checksum):
    edited = document(checksum=checksum)
    with pytest.raises(InputError, match="key 'checksum' does not fit the values"):
        parse_config(json.dumps(edited), "text")
    assert parse_config(json.dumps(edited), "text", check=False) == TunedConfig(light=ONE_BOUNCE)


def test_a_value_out_of_range_is_refused_as_such():
    """Not by the checksum, which is wrong too; and unchecked all the same."""
    edited = written()
    edited["parameters"]["intensity"] = 0.0
    for check in (True, False):
        with pytest.raises(InputError, match="parameters.intensity: must be"):
            parse_config(json.dumps(edited), "text", check=check)


@given(document=any_document())
@settings(max_examples=50, deadline=None, derandomize=True)
def test_a_file_that_was_formatted_anew_is_still_right(document):
    """Other order of keys, other white space, no escapes, and whole numbers without a point."""
    config = parse_config(json.dumps(document), "text")
    plain = json.loads(config_text(config))
    for text in (
        json.dumps(reversed_keys(plain)),
        json.dumps(plain, indent="\t", sort_keys=True),
        json.dumps(plain, separators=(",", ":"), ensure_ascii=False),
        json.dumps(without_fractions_of_zero(plain)),
    ):
        assert parse_config(text, "text") == config


def test_defaults_that_are_left_out_do_not_matter():
    """A member of the quality part that has its default may go: the checksum is of what the file means."""
    plain = written(TunedConfig())
    for name in list(plain["quality"]):
        del plain["quality"][name]
        assert parse_config(json.dumps(plain), "text") == TunedConfig()
    del plain["quality"], plain["visibility"]
    assert parse_config(json.dumps(plain), "text") == TunedConfig()


# What `vpltune fit` of version 0.2.0.dev0 wrote before there was the key `light`.
OLDER_THAN_LIGHT = """{"format": "vpltune", "version": 2, "visibility": "maps",
"quality": {"interleave": "auto", "map_size": 32, "map_refinement": 4, "adaptation_frames": 15.0,
"lloyd_iterations": 2}, "parameters": {"intensity": 1.0, "falloff_footprint": 1.0,
"extinction_coefficient": 0.0, "visibility_bias": 0.0005, "visibility_softness": 0.001, "vpl_count": 512,
"density_exponent": 1.0, "density_importance": 0.5, "screen_space_radius": 3.0,
"screen_space_strength": 0.0},
"checksum": "sha256:50f82cfc85c5b8ffd50761313059a15e67e0aff6d8e76b53d1384b6c7303282f"}"""


def test_a_file_that_is_older_than_light_has_one_bounce_and_keeps_its_checksum():
    """Written anew it says so, and has another checksum."""
    config = parse_config(OLDER_THAN_LIGHT, "text")
    assert config == TunedConfig(light=ONE_BOUNCE)
    anew = config_text(config)
    assert json.loads(anew)["light"] == {"bounces": 1, "sky_lights": 32}
    assert json.loads(anew)["checksum"] != json.loads(OLDER_THAN_LIGHT)["checksum"]
    assert parse_config(anew, "text") == config


@pytest.mark.parametrize("light", [{}, {"bounces": 1}, {"sky_lights": 32}])
def test_one_bounce_may_be_left_out_of_a_file_that_says_it(light):
    for written_first in (OLDER_THAN_LIGHT, config_text(TunedConfig(light=ONE_BOUNCE))):
        edited = json.loads(written_first) | {"light": light}
        assert parse_config(json.dumps(edited), "text") == TunedConfig(light=ONE_BOUNCE)


def test_files_are_checked_and_renewed(tmp_path):
    path = tmp_path / "tuned.json"
    write_config(path, CONFIG)
    path.write_text(path.read_text().replace('"vpl_count": 77', '"vpl_count": 78'))
    with pytest.raises(InputError, match=f"^{path}: key 'checksum' does not fit the values"):
        read_config(path)
    edited = read_config(path, check=False)
    assert edited.parameters.vpl_count == 78
    write_config(path, edited)
    assert read_config(path) == edited


def test_a_config_in_a_gltf_file_is_checked_too(tmp_path):
    (tmp_path / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}}))
    edited = written()
    write_gltf_extras(tmp_path / "a.gltf", tmp_path / "b.gltf", edited)
    assert read_config(tmp_path / "b.gltf") == CONFIG
    edited["parameters"]["intensity"] = 2.0
    write_gltf_extras(tmp_path / "a.gltf", tmp_path / "b.gltf", edited)
    with pytest.raises(InputError, match="b.gltf: key 'checksum' does not fit the values"):
        read_config(tmp_path / "b.gltf")
    assert read_config(tmp_path / "b.gltf", check=False).parameters.intensity == 2.0


def test_an_older_file_has_none_and_its_successor_has():
    config = parse_config(json.dumps(older_document()), "text")
    points = TunedConfig(point_vpls(), quality=OLDER_QUALITY, light=ONE_BOUNCE)
    assert written(config)["checksum"] == written(points)["checksum"]


def test_no_flipped_bit_passes_for_another_config():
    """A flip is refused, or the text still means the same: the 17th digit of a number, the e of an exponent.

    A flip in the name of the checksum must not do away with it.
    """
    text = config_text(CONFIG).encode()
    name = text.index(b"checksum")
    places = {*range(name - 4, name + 12), *np.random.default_rng(0).integers(0, len(text), 60).tolist()}
    for place in places:
        for bit in range(8):
            flipped = bytearray(text)
            flipped[place] ^= 1 << bit
            try:
                read = parse_config(flipped.decode("utf-8", "replace"), "text")
            except InputError:
                continue
            assert read == CONFIG, (text[place - 10 : place + 10], bytes(flipped[place - 10 : place + 10]))


@pytest.mark.parametrize("key", ["Checksum", "check_sum", "checksun", "\u0441hecksum"])
def test_a_near_miss_of_the_key_is_refused(key):
    edited = written()
    edited[key] = edited.pop("checksum")
    for check in (True, False):
        with pytest.raises(InputError, match="unknown key"):
            parse_config(json.dumps(edited), "text", check=check)
