"""The parameter table, and values checked against it."""

import dataclasses
import math

import pytest

from vpltune.renderer.config.artist_parameters import (
    ARTIST_PARAMETERS,
    ArtistParameters,
    ParameterSpec,
    parameter_spec,
)
from vpltune.renderer.errors import InputError

ROW = {
    "name": "width",
    "symbol": "w",
    "default": 2.0,
    "low": 1.0,
    "high": 3.0,
    "scale": "log",
    "unit": "1",
    "meaning": "how wide",
    "fitted": False,
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"low": 3.0}, "width: low must be less than high, got 3.0 and 3.0"),
        ({"default": 0.5}, r"width: default must lie in \[1.0, 3.0\], got 0.5"),
        ({"default": 3.5}, r"width: default must lie in \[1.0, 3.0\], got 3.5"),
        ({"low": 0.0}, "width: low must be positive on a log scale, got 0.0"),
        ({"high": math.inf}, "width: low, default and high must be finite"),
        ({"default": math.nan}, "width: low, default and high must be finite"),
        ({"default": 1.5, "whole_number": True}, "width: low, default and high must be whole numbers"),
    ],
)
def test_a_row_that_contradicts_itself_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        ParameterSpec(**(ROW | change))


def test_a_linear_row_may_start_at_zero():
    assert ParameterSpec(**(ROW | {"low": 0.0, "scale": "linear"})).low == 0.0


def test_parameters_have_exactly_the_names_of_the_table_in_its_order():
    names = [field.name for field in dataclasses.fields(ArtistParameters)]
    assert names == [spec.name for spec in ARTIST_PARAMETERS]
    assert len(set(names)) == len(names)


def test_defaults_are_those_of_the_table():
    assert ArtistParameters().as_dict() == {spec.name: spec.default for spec in ARTIST_PARAMETERS}


def test_the_tuner_fits_intensity_both_falloffs_and_what_maps_have():
    fitted = {spec.name for spec in ARTIST_PARAMETERS if spec.fitted}
    falloff = {"intensity", "falloff_footprint", "extinction_coefficient"}
    assert fitted == falloff | {"visibility_bias", "visibility_softness"}


@pytest.mark.parametrize("spec", ARTIST_PARAMETERS, ids=lambda spec: spec.name)
def test_bounds_are_allowed_and_anything_beyond_is_not(spec):
    defaults = ArtistParameters().as_dict()
    for bound in (spec.low, spec.high):
        assert getattr(ArtistParameters.validated(defaults | {spec.name: bound}), spec.name) == bound
    step = 1 if spec.whole_number else 1e-12
    for beyond in (spec.low - step, spec.high + max(step, spec.high * 1e-12), math.nan, math.inf, -math.inf):
        with pytest.raises(InputError, match=f"here.{spec.name}: must be .* got"):
            ArtistParameters.validated(defaults | {spec.name: beyond}, "here")


@pytest.mark.parametrize("value", [True, "1", None, [1.0], {}])
def test_what_is_not_a_number_is_refused(value):
    with pytest.raises(InputError, match="parameters.intensity: must be a number, got"):
        ArtistParameters.validated(ArtistParameters().as_dict() | {"intensity": value})


def test_a_fraction_of_a_vpl_is_refused():
    with pytest.raises(InputError, match="parameters.vpl_count: must be a whole number, got 1.5"):
        ArtistParameters.validated(ArtistParameters().as_dict() | {"vpl_count": 1.5})


def test_whole_numbers_written_as_floats_are_taken():
    parameters = ArtistParameters.validated(ArtistParameters().as_dict() | {"vpl_count": 256.0})
    assert parameters.vpl_count == 256
    assert isinstance(parameters.vpl_count, int)


def test_unknown_and_missing_names_are_named():
    defaults = ArtistParameters().as_dict()
    with pytest.raises(InputError, match="unknown key 'radius'; known are intensity, falloff_footprint"):
        ArtistParameters.validated(defaults | {"radius": 1.0})
    for name in defaults:
        without = {key: value for key, value in defaults.items() if key != name}
        with pytest.raises(InputError, match=f"parameters: key '{name}' is missing"):
            ArtistParameters.validated(without)


def test_a_row_is_found_by_its_name():
    assert parameter_spec("falloff_footprint").symbol == "α"
    with pytest.raises(KeyError):
        parameter_spec("radius")


def test_no_two_parameters_share_a_symbol():
    symbols = [spec.symbol for spec in ARTIST_PARAMETERS]
    assert len(set(symbols)) == len(symbols)
