"""A context that cannot serve is refused, and said to be so."""

import pytest

from vpltune.renderer.errors import MachineError
from vpltune.renderer.gpu import gpu_context
from vpltune.renderer.gpu.gpu_context import create_context


def test_too_few_bindings_are_said(gl_context, monkeypatch):
    monkeypatch.setattr(gpu_context, "MOST_BINDINGS", 100_000)
    with pytest.raises(MachineError, match="100000 storage buffers must be bound, .* binds"):
        create_context()
    gl_context.__enter__()


def test_an_older_opengl_is_said(gl_context, monkeypatch):
    monkeypatch.setattr(gpu_context, "REQUIRED_VERSION", 990)
    with pytest.raises(MachineError, match="OpenGL 990 is needed, .* offers [0-9]+; run: vpltune doctor"):
        create_context()
    gl_context.__enter__()
