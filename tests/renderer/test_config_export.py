"""Exports: JSON that reads back, GLSL that compiles and holds the same numbers."""

import json

import moderngl
import numpy as np
import pytest

from renderer.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from renderer.config_export import exported, glsl_constants, glsl_name
from renderer.errors import InputError
from renderer.tuned_config import TunedConfig, parse_config

CONFIG = TunedConfig(
    ArtistParameters(
        intensity=1.0 / 3.0,
        falloff_footprint=20.0,
        falloff_transmittance=1e-7,
        vpl_count=65536,
        density_exponent=0.0,
    ),
    {"scene": "a\nb é"},
)


def test_json_reads_back_and_is_normal():
    text = exported(CONFIG, "json")
    assert parse_config(text, "text") == CONFIG
    assert list(json.loads(text)["parameters"]) == [spec.name for spec in ARTIST_PARAMETERS]


def test_glsl_is_ascii_and_says_names_and_units():
    text = exported(CONFIG, "glsl")
    assert text.isascii()
    for spec in ARTIST_PARAMETERS:
        assert f" {glsl_name(spec)} = " in text
        assert f"// {spec.unit}\n" in text


def test_glsl_names():
    names = [glsl_name(spec) for spec in ARTIST_PARAMETERS]
    assert names[3:6] == ["VPL_VISIBILITY_BIAS", "VPL_VISIBILITY_SOFTNESS", "VPL_COUNT"]


def test_an_out_of_range_config_is_not_exported():
    with pytest.raises(InputError, match="parameters.intensity"):
        glsl_constants(TunedConfig(ArtistParameters(intensity=0.0)))


@pytest.mark.parametrize("version", ["330", "430"])
def test_glsl_compiles_and_gives_the_numbers_back(version):
    try:
        context = moderngl.create_standalone_context(backend="egl", require=330)
    except Exception as error:
        pytest.skip(f"no OpenGL context on this machine: {error}")
    constants = {spec.name: glsl_name(spec) for spec in ARTIST_PARAMETERS}
    names = list(constants)
    outputs = "".join(f"out float {name};\n" for name in names)
    body = "".join(f"{name} = float({constant});\n" for name, constant in constants.items())
    shader = f"#version {version} core\n{glsl_constants(CONFIG)}{outputs}void main() {{\n{body}}}\n"
    with context:
        program = context.program(vertex_shader=shader, varyings=names)
        output = context.buffer(reserve=4 * len(names))
        context.simple_framebuffer((1, 1)).use()  # without one, a headless context refuses every draw
        context.vertex_array(program, []).transform(output, mode=moderngl.POINTS, vertices=1)
        values = np.frombuffer(output.read(), np.float32)
    # A GLSL float literal is rounded to single precision, and to nothing less on any driver we know.
    np.testing.assert_allclose(values, list(CONFIG.parameters.as_dict().values()), rtol=1.2e-7)
    context.release()
