"""Many lights that cast shadows: as bright as one light of their sum, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.frame.rsm_resolution import (
    LEAST_RESOLUTION,
    MOST_FACES,
    MOST_TEXELS,
    RSM_RESOLUTION_OF_MANY,
    rsm_resolution,
)
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.render_targets import atlas_columns
from vpltune.renderer.scene.light_faces import face_count
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View


@pytest.fixture(scope="module")
def runtime():
    return Runtime(colored_room())


def means(runtime, kind, count):
    """Mean direct and indirect irradiance under `count` lights in one place, each with its share."""
    light = replace(ROOM_LIGHTS[kind], intensity=ROOM_LIGHTS[kind].intensity / count)
    camera = Camera(look_at(np.array([0.0, 0.0, 2.5]), np.zeros(3)), 0.8)
    # Without visibility maps: they know nothing of lights.
    config = TunedConfig(visibility="transmittance", light=ONE_BOUNCE)
    drawn = runtime.capture(View(kind, "fitted", (64, 48), camera, (light,) * count), config)
    return np.array([drawn.direct_irradiance[drawn.valid].mean(), drawn.vpl_irradiance[drawn.valid].mean()])


@pytest.mark.parametrize(
    ("kind", "count"),
    [
        ("point", 4),
        ("point", 33),
        ("spot", 33),
        ("directional", 33),
        *(pytest.param(kind, count, marks=pytest.mark.slow) for kind in ROOM_LIGHTS for count in (128, 1000)),
    ],
)
def test_many_lights_are_as_bright_as_their_sum(runtime, kind, count):
    """To 1.5 % direct and 2 % indirect: maps are coarser, and other samples make the discs.

    0.9 and 1.2 % were seen. While discs grew where samples of many lights overlap, 1,000 point lights had
    28 % less.
    """
    ratio = means(runtime, kind, count) / means(runtime, kind, 1)
    np.testing.assert_allclose(ratio[0], 1.0, atol=1.5e-2)
    np.testing.assert_allclose(ratio[1], 1.0, atol=2e-2)


def test_an_atlas_is_about_square_and_within_bounds():
    """Its sides stay within 16,384 texels, which drivers of this decade take."""
    point = ROOM_LIGHTS["point"]
    for count in (1, 2, 32, 33, 128, 1000, MOST_FACES // 6):
        lights = (point,) * count
        faces, resolution = face_count(lights, 0), rsm_resolution(lights)
        columns = atlas_columns(faces)
        rows = -(-faces // columns)
        assert LEAST_RESOLUTION <= resolution <= RSM_RESOLUTION_OF_MANY
        assert faces * resolution**2 <= MOST_TEXELS
        assert max(columns, rows) * resolution <= 16384
        assert columns % 6 == 0


def test_too_many_lights_are_refused_by_name():
    lights = (ROOM_LIGHTS["point"],) * (MOST_FACES // 6 + 1)
    with pytest.raises(InputError, match=r"at most 8,192 shadow map faces, got 1,366 lights"):
        rsm_resolution(lights)
