"""One full-screen draw for each dynamic light: what the light pre-pass replaces, kept to compare with."""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, create_irradiance_target
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.dynamic_lights import MIN_DISTANCE


class LightPerDrawPass:
    """G-buffer, lights → light accumulation, in as many draws as there are lights."""

    accumulation = "per_draw_light_accumulation"
    """The resource that it writes."""

    def __init__(self, resources: Resources):
        self._context = context = resources.context
        target = create_irradiance_target(context, resources.texture("gbuffer_depth").size)
        resources[self.accumulation] = target
        self._program = RasterProgram(
            resources,
            "techniques/light_per_draw",
            {"MIN_DISTANCE": MIN_DISTANCE},
            reads=(*GBUFFER_READS, "dynamic_lights"),
        )
        self._triangle = context.vertex_array(self._program.program, [])
        self._framebuffer = context.framebuffer([target])

    def draw(self, inputs: FrameInputs) -> None:
        """Accumulate the lights."""
        lights = inputs.dynamic_lights
        assert lights is not None, "a pre-pass without lights draws nothing"
        self._framebuffer.use()
        self._framebuffer.clear(0.0, 0.0, 0.0, 0.0)
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._program.bind(**inputs.camera.uniforms, accumulation_unit=lights.accumulation_unit)
        for light in range(len(lights)):
            self._program.program["light_index"] = light
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
