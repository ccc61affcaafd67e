"""docs/test_vectors.json: it is what its script makes, and shaders and surrogate gather as it says.

What it says of RSMs and of visibility maps is in test_rsm_vectors.py and test_visibility_vectors.py.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from glsl_results import glsl_results
from vector_file import BOUNDS, DIAGONAL, PI, REPOSITORY, VECTORS, light_buffers, light_of

from vpltune.renderer.frame import vpl_disc_bounds
from vpltune.renderer.frame.point_table import r2_sequence
from vpltune.renderer.scene.light_faces import light_records
from vpltune.renderer.scene.sun_faces import SunGrid
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather

CONSTANTS = ("intensity", "falloff_footprint", "extinction_coefficient")


def assert_same(found: Any, expected: Any, where: str = "") -> None:
    """Equal documents; numbers to 1e-7, for another machine may round sums otherwise."""
    if isinstance(expected, dict):
        assert list(found) == list(expected), where
        for key in expected:
            assert_same(found[key], expected[key], f"{where}.{key}")
    elif isinstance(expected, list):
        assert len(found) == len(expected), where
        for index, pair in enumerate(zip(found, expected, strict=True)):
            assert_same(*pair, f"{where}[{index}]")
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=1e-7, abs=1e-12), where
    else:
        assert found == expected, where


def test_the_file_is_what_its_script_makes(monkeypatch):
    """Else: python scripts/make_test_vectors.py."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    monkeypatch.syspath_prepend(str(REPOSITORY))
    import make_test_vectors

    assert_same(make_test_vectors.plain(make_test_vectors.test_vectors()), VECTORS)


def test_point_table():
    table = VECTORS["point_table"]
    points = r2_sequence(16)
    np.testing.assert_allclose(points, table["points"], atol=1e-7)
    turned = np.mod(points + np.float32(table["rotation"]), np.float32(1.0))
    np.testing.assert_allclose(turned, table["rotated"], atol=2e-7)


@pytest.mark.parametrize(
    "case", VECTORS["faces"], ids=lambda case: f"{len(case['faces'])}-{case['light']['type']}"
)
def test_faces_of_lights(case):
    grid = SunGrid(case["resolution"], (0.0, 0.0, 0.0), length=DIAGONAL)
    records = light_records((light_of(case["light"]),), BOUNDS, grid).faces
    assert len(records) == len(case["faces"])
    for record, face in zip(records, case["faces"], strict=True):
        np.testing.assert_allclose(record["light_to_world"].T, face["light_to_world"], atol=1e-6)
        np.testing.assert_allclose(record["extent"], face["extent"], rtol=1e-6)
        np.testing.assert_allclose(record["near_or_range"], face["near_or_range"], rtol=1e-6)
        assert bool(record["orthographic"]) == face["orthographic"]


@pytest.mark.parametrize("case", VECTORS["lights"], ids=lambda case: case["light"]["type"])
def test_irradiance_square_to_a_light(gl_context, case):
    """To 1e-4 of it: single precision near a cone's rim."""
    found = glsl_results(
        gl_context,
        ["common/lights.glsl"],
        {},
        "result3(to, irradiance_facing(lights[0], input3(first)));",
        np.array(case["position"]),
        3,
        light_buffers(gl_context, light_of(case["light"])),
    )
    np.testing.assert_allclose(found, case["irradiance_facing"], rtol=1e-4, atol=1e-6)


# Each pair of receiver and VPL to 1e-4, and to 1e-6 W/m² for a watt where it gives all but nothing.
TOLERANCE = {"rtol": 1e-4, "atol": 1e-6}


@pytest.mark.parametrize(
    "case",
    VECTORS["gather"]["cases"],
    ids=lambda case: "-".join(str(case[name]) for name in ("form", *CONSTANTS[1:])),
)
class TestGather:
    def test_shaders(self, gl_context, case):
        vectors = VECTORS["gather"]
        vpls, receivers = vectors["vpls"], vectors["receivers"]
        rows = [
            [*position, *normal, *place, *facing, footprint]
            for position, normal in zip(receivers["position"], receivers["normal"], strict=True)
            for place, facing, footprint in zip(
                vpls["position"], vpls["normal"], vpls["footprint"], strict=True
            )
        ]
        forms = {
            "point": "vpl_irradiance(position, normal, vpl, L, parameters).r",
            "disc": "max(dot(normal, disc_vector_irradiance(to_vpl, normal, vpl, L, parameters)), 0.0)",
        }
        constants = ", ".join(str(case[name]) for name in CONSTANTS)
        found = glsl_results(
            gl_context,
            [PI, "common/virtual_point_lights.glsl", "common/vpl_irradiance.glsl", "common/vpl_disc.glsl"],
            {**vpl_disc_bounds.DEFINES},
            f"""
            const float L = {vectors["scene_length"]};
            vec3 position = input3(first), normal = input3(first + 3u);
            VirtualPointLight vpl = VirtualPointLight(
                vec4(input3(first + 6u), inputs[first + 12u]), vec4(input3(first + 9u), 0.0), vec4(1.0));
            vec3 to_vpl = vpl.position_footprint.xyz - position;
            FalloffParameters parameters = FalloffParameters({constants});
            results[to] = {forms[case["form"]]};
            """,
            np.array(rows),
            1,
        )
        expected = np.array(case["irradiance_per_watt"])
        np.testing.assert_allclose(found.reshape(expected.shape), expected, **TOLERANCE)

    def test_surrogate(self, case):
        vectors = VECTORS["gather"]
        vpls, receivers, length = vectors["vpls"], vectors["receivers"], vectors["scene_length"]

        def single(values: Any, scale: float = 1.0) -> jnp.ndarray:
            return jnp.asarray(np.array(values) / scale, jnp.float32)

        image = gather(
            Receivers(single(receivers["position"], length), single(receivers["normal"])),
            VirtualPointLights(
                single(vpls["position"], length),
                single(vpls["normal"]),
                single(vpls["footprint"], length),
                single(vpls["flux"], length**2),
                case["form"] == "disc",
            ),
            FalloffParameters(*(jnp.float32(case[name]) for name in CONSTANTS)),
        )
        np.testing.assert_allclose(np.asarray(image), case["irradiance"], **TOLERANCE)
