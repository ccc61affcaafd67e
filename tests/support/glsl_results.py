"""Runs a function of our shaders on rows of numbers, one row an invocation, and reads its results back."""

import re
from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from vpltune.renderer.gpu.resources import Resource
from vpltune.renderer.gpu.shader_library import Define, read_shader, set_uniforms

_GROUP = 64
# Past the bindings that are given out below.
_INPUTS, _RESULTS = 40, 41
_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
_BINDING = re.compile(r"binding = (\w+)_BINDING\b")
_SAMPLER = re.compile(r"\buniform\s+sampler2D\s+(\w+)")


def glsl_results(
    context: moderngl.Context,
    includes: Sequence[str],
    defines: Mapping[str, Define],
    body: str,
    inputs: np.ndarray,
    result_width: int,
    resources: Mapping[str, Resource] | None = None,
    **uniforms: object,
) -> np.ndarray:
    """[rows, result_width] float32: `body` reads `inputs[first + i]` and writes `results[to + i]`.

    Args:
        includes: files of shaders/ in their order, or lines of GLSL between them.
        inputs: [rows, width]; one invocation for each row.
        resources: buffers and textures by the names that the shaders give them.
    """
    rows, width = inputs.shape
    text = _joined(includes)
    places = {name: place for place, name in enumerate(dict.fromkeys(_BINDING.findall(text)))}
    constants = {**defines, **{f"{name}_BINDING": place for name, place in places.items()}}
    program = context.compute_shader(
        f"""#version 450 core
{"".join(f"#define {name} {value}{chr(10)}" for name, value in constants.items())}
{text}
layout(local_size_x = {_GROUP}) in;
layout(std430, binding = {_INPUTS}) readonly buffer Inputs {{ float inputs[]; }};
layout(std430, binding = {_RESULTS}) writeonly buffer Results {{ float results[]; }};
vec3 input3(uint i) {{ return vec3(inputs[i], inputs[i + 1u], inputs[i + 2u]); }}
void result3(uint i, vec3 value) {{
    for (uint axis = 0u; axis < 3u; ++axis) {{ results[i + axis] = value[axis]; }}
}}
void main() {{
    uint row = gl_GlobalInvocationID.x;
    if (row >= {rows}u) {{ return; }}
    uint first = row * {width}u;
    uint to = row * {result_width}u;
{body}
}}
"""
    )
    given = context.buffer(np.ascontiguousarray(inputs, np.float32).tobytes())
    found = context.buffer(reserve=4 * rows * result_width)
    given.bind_to_storage_buffer(_INPUTS)
    found.bind_to_storage_buffer(_RESULTS)
    units = {name: unit for unit, name in enumerate(dict.fromkeys(_SAMPLER.findall(text)))}
    for name, resource in (resources or {}).items():
        if isinstance(resource, moderngl.Buffer):
            resource.bind_to_storage_buffer(places[name.upper()])
        else:
            resource.use(units[name])
    set_uniforms(program, **units, **uniforms)
    context.memory_barrier()
    program.run(-(-rows // _GROUP))
    context.memory_barrier()
    return np.frombuffer(found.read(), np.float32).reshape(rows, result_width)


def _joined(includes: Sequence[str]) -> str:
    """The files with what they include, each once."""
    seen: set[str] = set()

    def text(name: str) -> str:
        if name in seen:
            return ""
        seen.add(name)
        return _INCLUDE.sub(lambda match: text(match[1]), read_shader(name))

    return "\n".join(text(part) if part.endswith(".glsl") else part for part in includes)
