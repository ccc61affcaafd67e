"""Loads shaders: `#include`, constants owned by Python, and errors that name the right file and line."""

import hashlib
import re
from collections.abc import Mapping
from importlib import resources
from typing import Any

import moderngl
import numpy as np

Define = int | float | bool | str
"""A number, or a piece of GLSL on one line."""

MOST_WORKGROUPS = 65535
"""Along one side of a dispatch: what every driver takes ; every compute shader knows it."""

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
# Mesa: "0:12(5): error: …"; NVIDIA: "0(12) : error C1008: …".
_ERROR_PLACE = re.compile(r"\b(\d+)(?::(\d+)(\(\d+\))|\((\d+)\) ?)(?=\s*:)")


class ShaderError(RuntimeError):
    """A shader of ours does not compile or link: a fault of the program or the driver, not of the user."""


class ShaderSource:
    """One shader with its includes expanded, each file once, and `#line n id` at every change of file."""

    def __init__(self, name: str, defines: Mapping[str, Define]):
        self.files: list[str] = []
        body = "\n".join(self._expand(name))
        constants = "".join(
            f"#define {key} {_glsl_literal(value)}\n"
            for key, value in {"MOST_WORKGROUPS": MOST_WORKGROUPS, **defines}.items()
        )
        self.text = f"#version 450 core\n{constants}{body}\n"

    def _expand(self, name: str) -> list[str]:
        if name in self.files:
            return []
        identifier = len(self.files)
        self.files.append(name)
        lines = [f"#line 1 {identifier}"]
        for number, line in enumerate(read_shader(name).splitlines(), start=1):
            include = _INCLUDE.match(line)
            if include:
                lines += [*self._expand(include.group(1)), f"#line {number + 1} {identifier}"]
            else:
                lines.append(line)
        return lines

    def explain(self, log: str) -> str:
        """The driver's log with file numbers turned into names."""

        def place(match: re.Match[str]) -> str:
            identifier = int(match.group(1))
            line = match.group(2) or match.group(4)
            return f"{self.files[identifier]}:{line}" if identifier < len(self.files) else match.group(0)

        return _ERROR_PLACE.sub(place, log)


def read_shader(name: str) -> str:
    """The text of `shaders/<name>`.

    Raises:
        ShaderError: there is no such file.
    """
    try:
        return resources.files("vpltune.shaders").joinpath(name).read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"shaders/{name}: cannot be read ({error})") from error


def shaders_digest() -> str:
    """Hash of every shader that the runtime may compile: what is measured of them holds for these alone."""
    digest = hashlib.sha256()
    folder = resources.files("vpltune.shaders")
    parts = sorted((part for part in folder.iterdir() if part.is_dir()), key=lambda part: part.name)
    for part in parts:
        # The web page's shaders are compiled by a browser.
        if part.name in ("web", "__pycache__"):
            continue
        for file in sorted((f for f in part.iterdir() if f.is_file()), key=lambda f: f.name):
            digest.update(f"{part.name}/{file.name}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def compiled(context: moderngl.Context, sources: tuple[ShaderSource, ...]) -> Any:
    """The program of one compute shader (`moderngl.ComputeShader`), or of a vertex and a fragment shader
    (`moderngl.Program`), compiled once for each context and text.

    Raises:
        ShaderError: with the driver's log, in which file names and lines are put right.
    """
    if context.extra is None:
        context.extra = {}
    programs = context.extra.setdefault("programs", {})
    key = tuple(source.text for source in sources)
    if key not in programs:
        try:
            if len(sources) == 1:
                programs[key] = context.compute_shader(sources[0].text)
            else:
                vertex, fragment = (source.text for source in sources)
                programs[key] = context.program(vertex_shader=vertex, fragment_shader=fragment)
        except moderngl.Error as error:
            source = sources[-1] if "fragment_shader" in str(error) else sources[0]
            raise ShaderError(source.explain(str(error))) from error
    return programs[key]


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, **values: object) -> None:
    """Set the uniforms by name; those that the compiler found unused and removed are passed over.

    Matrices are given as numpy arrays, row by row as mathematics writes them.
    """
    for name, value in values.items():
        # `in` would walk through all names.
        uniform = program.get(name, None)
        if uniform is None:
            continue
        assert isinstance(uniform, moderngl.Uniform), f"{name} is no uniform"
        if isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value.T, np.float32))
        else:
            uniform.value = value


def _glsl_literal(value: Define) -> str:
    if isinstance(value, bool):
        return str(int(value))
    return repr(float(value)) if isinstance(value, float) else str(value)
