"""The list of pixels that a pass leaves to another: each is drawn once, however many there are."""

import numpy as np
import pytest

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.render_targets import create_pixel_list
from vpltune.renderer.gpu.shader_library import MOST_WORKGROUPS, read_shader

_HEAD = f"""#version 450 core
#define PIXEL_LIST_BINDING {buffer_bindings.PIXEL_LIST}
#define MOST_WORKGROUPS {MOST_WORKGROUPS}
{read_shader("common/pixel_list.glsl")}
layout(local_size_x = 64) in;
"""
APPEND = """
uniform ivec2 size;
void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (pixel.x < size.x) { append_pixel(pixel); }
}
"""
DRAW = """
layout(std430, binding = 0) buffer Drawn { uint drawn[]; };
uniform ivec2 size;
void main() {
    ivec2 pixel = listed_pixel(gl_WorkGroupID.xy, gl_LocalInvocationIndex);
    if (pixel.x >= 0) { atomicAdd(drawn[pixel.y * size.x + pixel.x], 1u); }
}
"""


@pytest.mark.parametrize("size", [(1, 1), (63, 2), (64, 3), (2100, 2000)])
def test_every_listed_pixel_is_drawn_once(gl_context, size):
    """2100×2000 pixels are more workgroups of 64 than drivers need take in a row."""
    pixels = create_pixel_list(gl_context, size)
    drawn = gl_context.buffer(bytes(4 * size[0] * size[1]))
    append, draw = (gl_context.compute_shader(_HEAD + main) for main in (APPEND, DRAW))
    pixels.clear()
    pixels.bind()
    append["size"] = draw["size"] = size
    append.run(-(-size[0] // 64), size[1])
    gl_context.memory_barrier()
    drawn.bind_to_storage_buffer(0)
    draw.run_indirect(pixels.buffer)
    gl_context.memory_barrier()
    assert (np.frombuffer(pixels.buffer.read(12), np.uint32) <= MOST_WORKGROUPS).all()
    np.testing.assert_array_equal(np.frombuffer(drawn.read(), np.uint32), 1)


def test_an_empty_list_draws_nothing(gl_context):
    pixels = create_pixel_list(gl_context, (8, 8))
    pixels.clear()
    groups = np.frombuffer(pixels.buffer.read(16), np.uint32)
    assert groups[:3].prod() == 0 and groups[3] == 0
