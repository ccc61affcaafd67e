"""`--sky` and `--environment`: what they mean, and what is refused before a scene is read."""

from pathlib import Path

import pytest

from vpltune.cli.chosen_view import chosen_view
from vpltune.cli.view_flags import sky_from_flags
from vpltune.cli.view_options import ViewFlags
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.placement.given_sky import GivenSky


def test_one_number_is_white():
    assert sky_from_flags("2", None) == GivenSky((2.0, 2.0, 2.0))
    assert sky_from_flags("1,2,3", None) == GivenSky((1.0, 2.0, 3.0))
    assert sky_from_flags(None, Path("a/sky.HDR")) == GivenSky(file="a/sky.HDR")
    assert sky_from_flags(None, None) is None


@pytest.mark.parametrize(
    ("sky", "environment", "said"),
    [
        ("1", "a.exr", "--sky and --environment: only one"),
        ("-1", None, "--sky: must be from 0 to"),
        ("1,2", None, "--sky: must be 1 or 3 finite numbers"),
        ("nan", None, "--sky: must be 1 or 3 finite numbers"),
        ("1e19", None, "--sky: must be from 0 to"),
        (None, "a.png", "--environment: must end in .exr or .hdr, got 'a.png'"),
    ],
)
def test_what_is_wrong_is_named(sky, environment, said):
    with pytest.raises(InputError) as error:
        sky_from_flags(sky, None if environment is None else Path(environment))
    assert said in str(error.value)


def test_a_view_of_a_file_takes_a_sky_but_no_camera(tmp_path):
    assert not ViewFlags(sky="1").place_a_view
    assert ViewFlags(sky="1", eye="0,0,0").place_a_view
    assert chosen_view(None, None, None, ViewFlags(sky="1")).sky == GivenSky((1.0, 1.0, 1.0))


def test_a_map_that_is_not_there_is_named():
    with pytest.raises(InputError, match="^--environment: 'no.hdr': cannot be read"):
        GivenSky(file="no.hdr").environment(None, "--environment")
