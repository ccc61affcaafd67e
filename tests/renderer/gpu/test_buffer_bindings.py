"""Storage buffers: each has a place of its own, and a machine with too few places is told so."""

import pytest

from vpltune.renderer.errors import MachineError
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.gpu_context import create_context


def test_every_buffer_has_a_place_of_its_own():
    """Two at one place would each be read as the other, without an error."""
    places = [place for name, place in buffer_bindings.DEFINES.items() if name.endswith("_BINDING")]
    assert sorted(places) == list(range(buffer_bindings.COUNT))


def test_too_few_places_are_said(gl_context, monkeypatch):
    monkeypatch.setattr(buffer_bindings, "COUNT", 100_000)
    with pytest.raises(MachineError, match="100000 storage buffers must be bound, .* binds"):
        create_context()
    gl_context.__enter__()
