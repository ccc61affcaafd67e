"""Shaders as they lie in the package."""

import re
from importlib import resources

import pytest

from vpltune.renderer.gpu.shader_library import ShaderError, ShaderSource, read_shader


def shader_files(folder, prefix: str = "") -> list[str]:
    found = []
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            found += shader_files(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith((".comp", ".vert", ".frag", ".glsl")):
            found.append(prefix + entry.name)
    return found


FILES = shader_files(resources.files("vpltune.shaders"))


@pytest.mark.parametrize("name", FILES)
def test_every_include_is_there(name):
    """Those of the web page too, which no runtime compiles; and each file comes once."""
    source = ShaderSource(name, {})
    assert source.files[0] == name
    assert len(set(source.files)) == len(source.files)
    assert "#include" not in source.text


def test_every_shader_is_included_or_is_a_shader_of_its_own():
    included = {
        found for name in FILES for found in re.findall(r'^\s*#include\s+"([^"]+)"', read_shader(name), re.M)
    }
    assert {name for name in FILES if name.endswith(".glsl")} <= included


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(ShaderError, match="shaders/common/absent.glsl: cannot be read"):
        read_shader("common/absent.glsl")
