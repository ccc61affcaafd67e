"""Programs that draw a scene: one for its opaque surfaces, and one that looks for holes in the others."""

from collections.abc import Mapping, Sequence

from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SCENE_READS, SceneBuffers
from vpltune.renderer.gpu.shader_library import Define, set_uniforms


class SceneProgram:
    """A raster program that draws the opaque surfaces of a scene, or all others.

    For the others, `HAS_ALPHA` is defined. Their shader may discard, which keeps GPUs from testing depth
    before it runs; so opaque surfaces have a program without.

    Args:
        resources: as of `RasterProgram`, and so are shader, defines and reads.
        scene: what is drawn.
        shader: its path below `shaders/`, without the ending.
        opaque: which surfaces.
        defines: constants that the shader is compiled with.
        reads: what it reads besides the scene.
    """

    def __init__(
        self,
        resources: Resources,
        scene: SceneBuffers,
        shader: str,
        *,
        opaque: bool,
        defines: Mapping[str, Define] | None = None,
        reads: Sequence[str] = (),
    ):
        self._scene = scene
        self._opaque = opaque
        both = {**(defines or {}), **({} if opaque else {"HAS_ALPHA": 1})}
        self._program = RasterProgram(resources, shader, both, reads=(*SCENE_READS, *reads))
        self._vertex_array = scene.vertex_array(self._program.program)

    def bind(self, **uniforms: object) -> None:
        """Bind everything for draws."""
        self._program.bind(**uniforms)

    def draw(self, **uniforms: object) -> None:
        """Draw, once bound."""
        set_uniforms(self._program.program, **uniforms)
        self._scene.draw(self._program, self._vertex_array, opaque=self._opaque)


def scene_programs(
    resources: Resources,
    scene: SceneBuffers,
    shader: str,
    reads: Sequence[str] = (),
    defines: Mapping[str, Define] | None = None,
) -> list[SceneProgram]:
    """The programs that draw all of a scene; one alone where every surface is opaque."""
    kinds = (True, False) if scene.has_holes else (True,)
    return [
        SceneProgram(resources, scene, shader, opaque=kind, defines=defines, reads=reads) for kind in kinds
    ]
