"""The parameters reach the GPU by one buffer, written when they change and not before."""

from dataclasses import replace

import moderngl
import pytest

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.gpu.parameter_buffer import ParameterBuffer

# Values that float32 holds exactly, none of them a default.
VALUES = {spec.name: spec.high if spec.whole_number else 0.0625 for spec in ARTIST_PARAMETERS}


@pytest.fixture
def writes(monkeypatch):
    """The sizes of all writes to buffers."""
    sizes = []
    write = moderngl.Buffer.write
    monkeypatch.setattr(
        moderngl.Buffer, "write", lambda self, data, **kw: sizes.append(len(data)) or write(self, data, **kw)
    )
    return sizes


def test_what_is_written_is_read_back(gl_context):
    values = VALUES | {"screen_space_radius": 4.0}
    buffer = ParameterBuffer(gl_context)
    buffer.write(ArtistParameters(**values))
    assert buffer.read() == ArtistParameters(**values)


def test_written_only_when_changed(gl_context, writes):
    buffer = ParameterBuffer(gl_context)
    parameters = ArtistParameters(intensity=2.0)
    for _ in range(3):
        buffer.write(replace(parameters))
    assert len(writes) == 1
    buffer.write(replace(parameters, intensity=3.0))
    assert len(writes) == 2
