"""The list of pixels that a pass leaves to another: each is drawn once, however many there are."""

import numpy as np
import pytest

from vpltune.renderer.gpu import shader_library
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import EMPTY_DISPATCH, create_pixel_list
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.shader_library import MOST_WORKGROUPS

HEAD = 'layout(local_size_x = 64) in;\n#include "common/pixel_list.glsl"\n'
SHADERS = {
    "append.comp": HEAD
    + """
uniform ivec2 size;
void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (pixel.x < size.x) { append_pixel(pixel); }
}
""",
    "draw.comp": HEAD
    + """
layout(std430, binding = DRAWN_BINDING) buffer Drawn { uint drawn[]; };
uniform ivec2 size;
void main() {
    ivec2 pixel = listed_pixel(gl_WorkGroupID.xy, gl_LocalInvocationIndex);
    if (pixel.x >= 0) { atomicAdd(drawn[pixel.y * size.x + pixel.x], 1u); }
}
""",
}


@pytest.fixture(autouse=True)
def shaders(monkeypatch):
    shipped = shader_library.read_shader
    monkeypatch.setattr(
        shader_library, "read_shader", lambda name: SHADERS[name] if name in SHADERS else shipped(name)
    )


@pytest.mark.parametrize("size", [(1, 1), (63, 2), (64, 3), (2100, 2000)])
def test_every_listed_pixel_is_drawn_once(gl_context, size):
    """2100×2000 pixels are more workgroups of 64 than drivers need take in a row."""
    resources = Resources(gl_context)
    resources["pixel_list"] = create_pixel_list(gl_context, size)
    resources["drawn"] = gl_context.buffer(bytes(4 * size[0] * size[1]))
    append = ComputeProgram(resources, "append", writes=("pixel_list",))
    draw = ComputeProgram(resources, "draw", reads=("pixel_list",), writes=("drawn",))
    resources.write("pixel_list", EMPTY_DISPATCH)
    append.dispatch(-(-size[0] // 64), size[1], size=size)
    draw.dispatch_indirect("pixel_list", size=size)
    assert (np.frombuffer(resources.read("pixel_list", 12), np.uint32) <= MOST_WORKGROUPS).all()
    np.testing.assert_array_equal(np.frombuffer(resources.read("drawn"), np.uint32), 1)


def test_an_empty_list_draws_nothing(gl_context):
    resources = Resources(gl_context)
    resources["pixel_list"] = create_pixel_list(gl_context, (8, 8))
    resources["drawn"] = gl_context.buffer(bytes(4 * 64))
    resources.write("pixel_list", EMPTY_DISPATCH)
    groups = np.frombuffer(resources.read("pixel_list", 16), np.uint32)
    assert groups[:3].prod() == 0 and groups[3] == 0
    draw = ComputeProgram(resources, "draw", reads=("pixel_list",), writes=("drawn",))
    draw.dispatch_indirect("pixel_list", size=(8, 8))
    assert not np.frombuffer(resources.read("drawn"), np.uint32).any()
