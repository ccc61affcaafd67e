"""Exports: every form read back by what it is made for, with the same numbers."""

import json
import re
import shutil
import subprocess

import moderngl
import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.parameter_block import pack_parameters, unpack_parameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import VISIBILITIES, TunedConfig, parse_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.config_export import (
    VISIBILITY_CODES,
    beyond_constants,
    c_header,
    constant_name,
    exported,
    glsl_constants,
)

CONFIG = TunedConfig(
    ArtistParameters(
        intensity=1.0 / 3.0,
        falloff_footprint=20.0,
        extinction_coefficient=1e-7,
        vpl_count=65536,
        density_exponent=0.0,
    ),
    {"scene": "a\nb é"},
    quality=Quality(interleave=4, rsm_resolution=512),
)


def test_json_reads_back_and_is_normal():
    text = exported(CONFIG, "json").decode()
    assert parse_config(text, "text") == CONFIG
    document = json.loads(text)
    assert list(document["parameters"]) == [
        spec.name for spec in ARTIST_PARAMETERS if spec.part == "parameters"
    ]
    assert {spec.name for spec in ARTIST_PARAMETERS if spec.part == "quality"} <= set(document["quality"])


def test_glsl_is_ascii_and_says_names_and_units():
    text = exported(CONFIG, "glsl").decode("ascii")
    for spec in ARTIST_PARAMETERS:
        assert f" {constant_name(spec)} = " in text
        assert f"// {spec.unit}\n" in text


def test_constant_names():
    names = [constant_name(spec) for spec in ARTIST_PARAMETERS]
    assert names[3:6] == ["VPL_VISIBILITY_BIAS", "VPL_VISIBILITY_SOFTNESS", "VPL_COUNT"]


def test_an_out_of_range_config_is_not_exported():
    with pytest.raises(InputError, match="parameters.intensity"):
        glsl_constants(TunedConfig(ArtistParameters(intensity=0.0)))


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_texts_hold_every_digit_and_the_visibility(visibility):
    config = CONFIG.seen_by(visibility)
    values = config.parameters.as_dict()
    for text, pattern in (
        (glsl_constants(config), r"const (?:int|float) (\w+) = (\S+);"),
        (c_header(config), r"#define (\w+) (\S+) /\*"),
    ):
        found = dict(re.findall(pattern, text))
        assert {spec.name: float(found[constant_name(spec)]) for spec in ARTIST_PARAMETERS} == values
        assert int(found["VPL_VISIBILITY"]) == VISIBILITY_CODES[visibility]


def test_codes_of_the_visibility_are_those_that_shaders_were_written_for():
    """0 was a mode that is no more; the others keep their numbers."""
    assert VISIBILITY_CODES == {"transmittance": 1, "maps": 2}
    for visibility, code in VISIBILITY_CODES.items():
        text = glsl_constants(CONFIG.seen_by(visibility))
        assert f"const int VPL_VISIBILITY = {code}; // 1 transmittance, 2 maps\n" in text
        assert f"#define VPL_VISIBILITY {code} " in c_header(CONFIG.seen_by(visibility))


@pytest.mark.parametrize(
    ("quality", "expected"),
    [
        (Quality(), {"INTERLEAVE": 0, "MAP_SIZE": 32, "MAP_REFINEMENT": 4, "RSM_RESOLUTION": 0}),
        (
            Quality(interleave=8, map_size=12, map_refinement=1, rsm_resolution=512),
            {"INTERLEAVE": 8, "MAP_SIZE": 12, "MAP_REFINEMENT": 1, "RSM_RESOLUTION": 512},
        ),
    ],
)
def test_the_quality_settings_are_constants_too(quality, expected):
    """Interleaving or a resolution of 0 leaves it to who reads it."""
    config = TunedConfig(quality=quality)
    expected = {"BOUNCES": 0, **expected}
    for text, pattern in (
        (glsl_constants(config), r"^const int VPL_(\w+) = (\d+);$"),
        (c_header(config), r"^#define VPL_(\w+) (\d+)$"),
    ):
        found = {name: int(value) for name, value in re.findall(pattern, text, re.MULTILINE)}
        assert found == expected


@pytest.mark.parametrize(("bounces", "words"), [(1, None), (3, "3 bounces"), ("all", "all bounces")])
def test_bounces_are_a_constant_and_more_than_one_is_said(bounces, words):
    """An engine that draws the first bounce alone has less light than the parameters were tuned to."""
    config = TunedConfig(light=LightSettings(bounces))
    for text, form in ((glsl_constants(config), "glsl"), (c_header(config), "c")):
        assert f"VPL_BOUNCES {'= ' * (form == 'glsl')}{0 if bounces == 'all' else bounces}" in text
        said = beyond_constants(config, form)
        assert len(said) == (words is not None)
        assert all(words in sentence and sentence in text for sentence in said)
    assert beyond_constants(config, "json") == ()


def test_std140_bytes_are_the_parameter_block():
    content = exported(CONFIG, "std140")
    assert content == pack_parameters(CONFIG.parameters)
    for name, value in unpack_parameters(content).as_dict().items():
        assert np.float32(value) == np.float32(CONFIG.parameters.as_dict()[name]), name


_C_PROGRAM = """
#include <stdio.h>
#include "tuned.h"
int main(void) {
    fwrite(&vpl_parameters, sizeof vpl_parameters, 1, stdout);
    return 0;
}
"""


@pytest.mark.parametrize("language", [["-xc", "-std=c99"], ["-xc++", "-std=c++11"]], ids=["C", "C++"])
def test_the_c_header_compiles_and_its_struct_is_the_block(tmp_path, language):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    (tmp_path / "tuned.h").write_bytes(exported(CONFIG, "c"))
    (tmp_path / "main.c").write_text(_C_PROGRAM)
    program = tmp_path / "main"
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command = [compiler, *warnings, *language, str(tmp_path / "main.c"), "-o", str(program)]
    compiled = subprocess.run(command, capture_output=True, text=True, check=False)
    if "C++" in compiled.stderr or "cc1plus" in compiled.stderr:
        pytest.skip("the compiler speaks no C++")
    assert compiled.returncode == 0, compiled.stderr
    assert subprocess.run([program], capture_output=True, check=True).stdout == pack_parameters(
        CONFIG.parameters
    )


def test_the_exported_glsl_block_reads_the_exported_bytes(gl_context):
    outputs = "".join(f"out float o_{spec.name};\n" for spec in ARTIST_PARAMETERS)
    body = "".join(f"o_{spec.name} = float({constant_name(spec)});\n" for spec in ARTIST_PARAMETERS)
    program = gl_context.program(
        vertex_shader="#version 330 core\n#define VPL_PARAMETER_BLOCK\n"
        f"{glsl_constants(TunedConfig())}{outputs}void main() {{\n{body}}}\n",
        varyings=[f"o_{spec.name}" for spec in ARTIST_PARAMETERS],
    )
    block = gl_context.buffer(exported(CONFIG, "std140"))
    program["VplParameters"].binding = 2
    block.bind_to_uniform_block(2)
    output = gl_context.buffer(reserve=4 * len(ARTIST_PARAMETERS))
    gl_context.simple_framebuffer((1, 1)).use()  # without one, a headless context refuses every draw
    gl_context.vertex_array(program, []).transform(output, mode=moderngl.POINTS, vertices=1)
    np.testing.assert_array_equal(
        np.frombuffer(output.read(), np.float32), np.float32(list(CONFIG.parameters.as_dict().values()))
    )


@pytest.mark.parametrize("version", ["330", "430"])
def test_glsl_compiles_and_gives_the_numbers_back(version):
    try:
        context = moderngl.create_standalone_context(backend="egl", require=330)
    except Exception as error:
        pytest.skip(f"no OpenGL context on this machine: {error}")
    constants = {spec.name: constant_name(spec) for spec in ARTIST_PARAMETERS}
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
