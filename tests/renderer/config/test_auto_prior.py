"""A prior in a config file: read as it was written, and refused by key where something is wrong."""

import dataclasses
import json
import math

import numpy as np
import pytest
from made_priors import made_prior

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.config_schema import config_schema
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import (
    TunedConfig,
    config_text,
    parse_config,
    read_config,
    write_config,
)
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.config_export import exported

CONFIG = TunedConfig(ArtistParameters(vpl_count=64), {"seed": 7}, "maps", made_prior())


def document() -> dict:
    """As it is written, but without the checksum, which no change below would fit."""
    written = json.loads(config_text(CONFIG))
    del written["checksum"]
    return written


def test_what_is_written_reads_back_equal(tmp_path):
    write_config(tmp_path / "auto.json", CONFIG)
    assert read_config(tmp_path / "auto.json") == CONFIG


def test_the_schema_takes_it():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.validate(document(), config_schema())


def test_the_shipped_prior():
    """`auto` is a preset for discs that see by maps, and what it says lies within every bound."""
    config = read_config("auto")
    assert config.visibility == "maps"
    assert config.parameters.vpls_are_discs
    assert config.auto is not None
    for statistics in (np.zeros(len(STATISTIC_NAMES)), np.ones(len(STATISTIC_NAMES))):
        found = config.auto.parameters(statistics, config.parameters)
        assert ArtistParameters.validated(found.as_dict()) == found
        kept = {s.name for s in ARTIST_PARAMETERS} - set(AUTO_PARAMETERS)
        assert all(getattr(found, name) == getattr(config.parameters, name) for name in kept)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda auto: auto.pop("bias"), "auto: key 'bias' is missing"),
        (lambda auto: auto.update(extra=1), "auto: unknown key 'extra'"),
        (lambda auto: auto["statistics"].pop(), r"auto.statistics: must be visible, .*, got"),
        (lambda auto: auto["parameters"].reverse(), r"auto.parameters: must be intensity, "),
        (lambda auto: auto["weights"].pop(), "auto.weights: must be a list of 4 rows"),
        (lambda auto: auto["weights"][1].pop(), r"auto.weights\[1\]: must be a list of 12 numbers"),
        (lambda auto: auto.update(bias=[]), "auto.bias: must be a list of 4 numbers"),
        (lambda auto: auto["weights"][0].__setitem__(0, math.nan), r"auto.weights\[0\]: weights are from"),
        (lambda auto: auto["bias"].__setitem__(0, 1e999), "auto.bias: weights are from"),
        (lambda auto: auto["bias"].__setitem__(0, True), "auto.bias: weights are from"),
        (
            lambda auto: auto["lowest"].__setitem__(0, 0.9),
            "auto: 0 ≤ lowest ≤ highest ≤ 1 must hold, got 0.9",
        ),
    ],
)
def test_a_bad_prior_is_refused_by_key(change, message):
    broken = document()
    broken["auto"]["highest"][0] = 0.8
    change(broken["auto"])
    with pytest.raises(InputError, match=message):
        parse_config(json.dumps(broken), "auto.json")


def test_a_prior_goes_with_maps():
    broken = document() | {"visibility": "transmittance"}
    with pytest.raises(InputError, match="key 'auto' goes with visibility 'maps', got 'transmittance'"):
        parse_config(json.dumps(broken), "auto.json")
    assert CONFIG.seen_by("maps") == CONFIG
    with pytest.raises(InputError, match="a config with 'auto' goes with maps, got transmittance"):
        CONFIG.seen_by("transmittance")


@pytest.mark.parametrize("iterations", [0, 2, 4])
def test_a_prior_is_read_with_any_placement(iterations):
    """It is trained for clustered discs; files of version 1 have one with points."""
    changed = document()
    changed["quality"]["lloyd_iterations"] = iterations
    config = parse_config(json.dumps(changed), "auto.json")
    assert config.auto == CONFIG.auto
    assert config.parameters.lloyd_iterations == iterations


@pytest.mark.parametrize("form", ["glsl", "c", "std140"])
def test_a_prior_is_not_exported_as_constants(form):
    with pytest.raises(InputError, match="sets its parameters anew in each frame; fit a scene from it first"):
        exported(CONFIG, form)
    assert parse_config(exported(CONFIG, "json").decode(), "json") == CONFIG


@pytest.mark.parametrize("spec", ARTIST_PARAMETERS, ids=lambda spec: spec.name)
def test_places_and_values_undo_each_other(spec):
    for place in (0.0, 0.3, 1.0):
        assert spec.place_of(spec.value_at(place)) == pytest.approx(place, abs=1e-12)
    assert spec.within(spec.place_of(spec.low)) == spec.low
    assert spec.within(1.0 + 1e-12) <= spec.high


def test_a_prior_stays_where_it_was_trained():
    """However odd the statistics are."""
    narrow = dataclasses.replace(made_prior(strength=10.0), lowest=(0.4,) * 4, highest=(0.6,) * 4)
    for seed in range(20):
        point = narrow.point(np.random.default_rng(seed).normal(0.0, 100.0, len(STATISTIC_NAMES)))
        assert (point >= 0.4).all() and (point <= 0.6).all()
    assert isinstance(narrow, AutoPrior)


def test_the_value_at_a_place_is_the_tables_scale():
    """α runs logarithmically from 0.05 to 20: halfway lies their geometric mean."""
    assert parameter_spec("falloff_footprint").value_at(0.5) == pytest.approx(1.0)
    assert parameter_spec("extinction_coefficient").value_at(0.5) == pytest.approx(4.0)
