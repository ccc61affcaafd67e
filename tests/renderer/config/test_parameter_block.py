"""The parameter block: its offsets and bytes against what OpenGL itself makes of the block."""

import moderngl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.config.parameter_block import (
    BLOCK_BYTES,
    BLOCK_FIELDS,
    glsl_block,
    pack_parameters,
    unpack_parameters,
)
from vpltune.renderer.errors import InputError

# No two values alike, so that a swap of two fields shows.
PARAMETERS = ArtistParameters(
    **{
        spec.name: (spec.low + spec.high) // 3
        if spec.whole_number
        else spec.low + (spec.high - spec.low) / (3.0 + index)
        for index, spec in enumerate(ARTIST_PARAMETERS)
    }
)


def _any_parameters() -> st.SearchStrategy[ArtistParameters]:
    def values(spec):
        if spec.whole_number:
            return st.integers(spec.low, spec.high)
        return st.floats(spec.low, spec.high) | st.sampled_from([spec.low, spec.high])

    return st.builds(ArtistParameters, **{spec.name: values(spec) for spec in ARTIST_PARAMETERS})


@given(_any_parameters())
def test_unpacking_gives_back_what_was_packed_in_single_precision(parameters):
    values = unpack_parameters(pack_parameters(parameters)).as_dict()
    for name, value in parameters.as_dict().items():
        assert values[name] == value or np.float32(values[name]) == np.float32(value), name


def test_padding_is_zero_and_fields_follow_the_table():
    content = pack_parameters(PARAMETERS)
    assert len(content) == BLOCK_BYTES and BLOCK_BYTES % 16 == 0
    assert not any(content[4 * len(BLOCK_FIELDS) :])
    assert [field.name for field in BLOCK_FIELDS] == [spec.name for spec in ARTIST_PARAMETERS]


@pytest.mark.parametrize("storage", ["uniform", "buffer"])
def test_a_shader_reads_every_field_where_it_was_packed(gl_context, storage):
    reads = "\n".join(f"values[{i}] = float({field.name});" for i, field in enumerate(BLOCK_FIELDS))
    program = gl_context.compute_shader(
        "#version 450 core\nlayout(local_size_x = 1) in;\n"
        f"{glsl_block(storage, 3, access='readonly' if storage == 'buffer' else '')}"
        "layout(std430, binding = 4) writeonly buffer Values { float values[]; };\n"
        f"void main() {{\n{reads}\n}}\n"
    )
    block = gl_context.buffer(pack_parameters(PARAMETERS))
    if storage == "uniform":
        block.bind_to_uniform_block(3)
        # What the driver itself says of the block's size.
        assert program["ArtistParameters"].size == BLOCK_BYTES
    else:
        block.bind_to_storage_buffer(3)
    values = gl_context.buffer(reserve=4 * len(BLOCK_FIELDS))
    values.bind_to_storage_buffer(4)
    program.run(1)
    gl_context.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT)
    read = np.frombuffer(values.read(), np.float32)
    np.testing.assert_array_equal(read, np.float32(list(PARAMETERS.as_dict().values())))


def test_a_shader_that_writes_the_block_is_understood(gl_context):
    writes = "\n".join(
        f"{field.name} = {field.glsl_type}({value!r});"
        for field, value in zip(BLOCK_FIELDS, PARAMETERS.as_dict().values(), strict=True)
    )
    program = gl_context.compute_shader(
        "#version 450 core\nlayout(local_size_x = 1) in;\n"
        f"{glsl_block('buffer', 3)}void main() {{\n{writes}\n}}\n"
    )
    block = gl_context.buffer(bytes(BLOCK_BYTES))
    block.bind_to_storage_buffer(3)
    program.run(1)
    gl_context.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT)
    assert block.read() == pack_parameters(PARAMETERS)


def test_bytes_of_another_size_or_out_of_range_are_refused():
    with pytest.raises(ValueError, match=f"{BLOCK_BYTES} bytes, got 4"):
        unpack_parameters(b"\0\0\0\0")
    content = bytearray(pack_parameters(PARAMETERS))
    content[:4] = np.float32(np.nan).tobytes()
    with pytest.raises(InputError, match=r"parameter block\.intensity"):
        unpack_parameters(bytes(content))
    with pytest.raises(InputError, match=r"parameters\.intensity"):
        pack_parameters(ArtistParameters(intensity=float("inf")))
