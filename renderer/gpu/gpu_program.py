"""GPU programs that declare by name what they read and write.

A declaration is a resource's name, or "resource as name" where the shader calls it otherwise:

    ComputeProgram(resources, "display/tone_mapping", reads=("radiance", "exposure"), writes=("display",))

It gives each name its binding, which the shader takes from a macro: `EXPOSURE_BINDING` for a buffer,
`DISPLAY_IMAGE` for a texture that is written. A texture that is read has the declared name as its sampler. A
buffer that a shader uses without declaring it does not compile; the reverse raises ValueError.
"""

import re
from collections.abc import Mapping, Sequence

import moderngl

from vpltune.renderer.config.parameter_block import BLOCK_MEMBERS
from vpltune.renderer.gpu.resources import COMMANDS, IMAGE, SAMPLED, STORAGE, Access, Resources
from vpltune.renderer.gpu.shader_library import Define, ShaderSource, compiled, set_uniforms

_SAMPLER = re.compile(r"\buniform\s+sampler2D\s+(\w+)")


class _Declaration:
    """What a program reads and writes: resource names by the names that its shader uses."""

    def __init__(self, shader: str, reads: Sequence[str], writes: Sequence[str]):
        self.shader = shader
        self.reads, self.writes = _by_shader_name(reads), _by_shader_name(writes)
        both = [*self.reads, *self.writes]
        if len(set(both)) != len(reads) + len(writes):
            raise ValueError(f"{shader}: a name is declared more than once in {[*reads, *writes]}")
        self.units = {name: unit for unit, name in enumerate(both)}
        self.image_units = {name: unit for unit, name in enumerate(self.writes)}

    def defines(self) -> dict[str, Define]:
        """The binding macros."""
        bindings = {f"{name.upper()}_BINDING": unit for name, unit in self.units.items()}
        images = {f"{name.upper()}_IMAGE": unit for name, unit in self.image_units.items()}
        return {**bindings, **images, "ARTIST_PARAMETERS_MEMBERS": BLOCK_MEMBERS}

    def check(self, text: str, program: moderngl.Program | moderngl.ComputeShader) -> None:
        """Raise ValueError unless the shader's text uses every name, and the program samples no other."""
        samplers = set(_SAMPLER.findall(text))
        for name in self.units:
            if name not in samplers and not re.search(rf"= {name.upper()}_(BINDING|IMAGE)\b", text):
                raise ValueError(f"{self.shader}: declares '{name}', which its shader does not use")
        for name in samplers - set(self.units):
            if program.get(name, None) is not None:
                raise ValueError(f"{self.shader}: samples '{name}', which it does not declare")

    def bind(self, resources: Resources, commands: str | None = None) -> None:
        """Place the barriers and bind everything."""
        accesses = [] if commands is None else [Access(commands, COMMANDS)]
        for name, resource_name in self.reads.items():
            resource = resources[resource_name]
            if isinstance(resource, moderngl.Buffer):
                accesses.append(Access(resource_name, STORAGE))
                resource.bind_to_storage_buffer(self.units[name])
            else:
                accesses.append(Access(resource_name, SAMPLED))
                resource.use(self.units[name])
        for name, resource_name in self.writes.items():
            resource = resources[resource_name]
            if isinstance(resource, moderngl.Buffer):
                accesses.append(Access(resource_name, STORAGE, writes=True))
                resource.bind_to_storage_buffer(self.units[name])
            else:
                accesses.append(Access(resource_name, IMAGE, writes=True))
                resource.bind_to_image(self.image_units[name], read=False, write=True)
        resources.access(accesses)

    def sampler_units(self) -> dict[str, int]:
        """The unit of every name that may be a sampler."""
        return {name: self.units[name] for name in self.reads}


class ComputeProgram:
    """A compute shader with its declaration.

    Args:
        resources: where the declared names are looked up, at every dispatch.
        shader: its path below `shaders/`, without the ending.
        defines: constants that the shader is compiled with.
        reads: buffers and textures that it only reads.
        writes: buffers and textures that it writes; a buffer may be read too.

    Raises:
        ShaderError: the shader does not compile.
        ValueError: the declaration does not fit the shader.
    """

    def __init__(
        self,
        resources: Resources,
        shader: str,
        defines: Mapping[str, Define] | None = None,
        *,
        reads: Sequence[str] = (),
        writes: Sequence[str] = (),
    ):
        self._resources = resources
        self._declaration = _Declaration(shader, reads, writes)
        source = ShaderSource(f"{shader}.comp", {**self._declaration.defines(), **(defines or {})})
        self._program: moderngl.ComputeShader = compiled(resources.context, (source,))
        self._declaration.check(source.text, self._program)
        set_uniforms(self._program, **self._declaration.sampler_units())

    def dispatch(self, *groups: int, **uniforms: object) -> None:
        """Run so many workgroups along x, y and z."""
        self._declaration.bind(self._resources)
        set_uniforms(self._program, **uniforms)
        self._program.run(*groups)

    def dispatch_indirect(self, commands: str, **uniforms: object) -> None:
        """Run as many workgroups as the buffer called `commands` begins with."""
        self._declaration.bind(self._resources, commands)
        set_uniforms(self._program, **uniforms)
        self._program.run_indirect(self._resources.buffer(commands))


class RasterProgram:
    """A vertex and a fragment shader with what they read; they write the framebuffer in use.

    Args and raises as `ComputeProgram`. A texture called `base_color_texture` is bound by
    `SceneBuffers.draw`.
    """

    def __init__(
        self,
        resources: Resources,
        shader: str,
        defines: Mapping[str, Define] | None = None,
        *,
        reads: Sequence[str] = (),
    ):
        self._resources = resources
        self._declaration = _Declaration(shader, reads, ())
        both = {**self._declaration.defines(), **(defines or {})}
        sources = ShaderSource(f"{shader}.vert", both), ShaderSource(f"{shader}.frag", both)
        self.program: moderngl.Program = compiled(resources.context, sources)
        self._declaration.check("\n".join(source.text for source in sources), self.program)
        set_uniforms(self.program, **self._declaration.sampler_units())

    def bind(self, **uniforms: object) -> None:
        """Bind everything for draws."""
        self._declaration.bind(self._resources)
        set_uniforms(self.program, **uniforms)

    def reads(self, name: str) -> bool:
        """Whether a name is declared."""
        return name in self._declaration.units

    def unit(self, name: str) -> int:
        """The texture unit of a declared name."""
        return self._declaration.units[name]


def _by_shader_name(declared: Sequence[str]) -> dict[str, str]:
    names = {}
    for text in declared:
        resource, _, name = text.partition(" as ")
        names[name or resource] = resource
    return names
