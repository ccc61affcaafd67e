"""Runs a function of our shaders on rows of numbers, one row an invocation, and reads its results back."""

import re
from collections.abc import Callable, Mapping, Sequence

import moderngl
import numpy as np

from vpltune.renderer.gpu.shader_library import Define, read_shader

_GROUP = 64
# Past the bindings that shaders use themselves.
_INPUTS, _RESULTS = 40, 41
_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)


def glsl_results(
    context: moderngl.Context,
    includes: Sequence[str],
    defines: Mapping[str, Define],
    body: str,
    inputs: np.ndarray,
    result_width: int,
    prepare: Callable[[moderngl.ComputeShader], object] | None = None,
) -> np.ndarray:
    """[rows, result_width] float32: `body` reads `inputs[first + i]` and writes `results[to + i]`.

    Args:
        includes: files of shaders/ in their order, or lines of GLSL between them.
        inputs: [rows, width]; one invocation for each row.
        prepare: sets the program's uniforms.
    """
    rows, width = inputs.shape
    constants = "".join(f"#define {name} {value}\n" for name, value in defines.items())
    program = context.compute_shader(
        f"""#version 450 core
{constants}
{_joined(includes)}
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
    if prepare is not None:
        prepare(program)
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
