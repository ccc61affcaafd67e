"""The checksum of a config: what docs/file_formats.md says it is, of values and not of their formatting."""

import hashlib
import json
from dataclasses import replace

import pytest

from vpltune.renderer.config.quality import MetBudget, Quality
from vpltune.renderer.config.tuned_config import FitNote, TunedConfig, config_text, parse_config, read_config
from vpltune.renderer.errors import InputError

CONFIG = TunedConfig(
    provenance={"scene": "Küche", "views": 4, "seed": 0},
    quality=Quality(interleave=4, budget=MetBudget(16.0, (1920, 1080), "a GPU")),
    fit=FitNote("improved", "relMSE ×0.4"),
)


def whole_numbers(value):
    """As JavaScript writes numbers: 15.0 becomes 15."""
    if isinstance(value, dict):
        return {key: whole_numbers(each) for key, each in value.items()}
    if isinstance(value, list):
        return [whole_numbers(each) for each in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


@pytest.mark.parametrize("config", [CONFIG, TunedConfig(), read_config("auto")])
def test_checksum_is_of_the_rest_with_sorted_keys_and_no_blanks(config):
    """As a reader in another program would take it."""
    document = json.loads(config_text(config))
    checksum = document.pop("checksum")
    canonical = json.dumps(whole_numbers(document), sort_keys=True, separators=(",", ":"))
    assert checksum == "sha256:" + hashlib.sha256(canonical.encode("ascii")).hexdigest()


@pytest.mark.parametrize("config", [CONFIG, TunedConfig(), read_config("auto")])
def test_formatting_does_not_matter(config):
    document = json.loads(config_text(config))
    shuffled = {key: document[key] for key in sorted(document, reverse=True)}
    assert parse_config(json.dumps(whole_numbers(shuffled)), "text") == config


def test_values_matter():
    document = json.loads(config_text(CONFIG))
    document["parameters"]["intensity"] = 1.5
    with pytest.raises(InputError, match="key 'checksum' does not fit the values"):
        parse_config(json.dumps(document), "text")
    changed = replace(CONFIG, parameters=replace(CONFIG.parameters, intensity=1.5))
    assert parse_config(json.dumps(document), "text", check=False) == changed
