"""What was measured of the shaders is known by their text."""

import shutil
from pathlib import Path

from vpltune import shaders
from vpltune.renderer.gpu import shader_library


def test_another_text_is_another_digest(tmp_path, monkeypatch):
    folder = tmp_path / "shaders"
    shutil.copytree(Path(shaders.__file__).parent, folder)
    shipped = shader_library.shaders_digest()
    monkeypatch.setattr(shader_library.resources, "files", lambda package: folder)
    assert shader_library.shaders_digest() == shipped
    shared = folder / "common" / "vpl_disc.glsl"
    text = shared.read_text()
    shared.write_text(text + "\n")
    assert shader_library.shaders_digest() != shipped
    shared.write_text(text)
    assert shader_library.shaders_digest() == shipped
