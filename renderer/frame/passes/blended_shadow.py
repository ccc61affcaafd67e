"""Shadows of scenes with blended surfaces: how much light passes those before what stops it wholly.

The RSM shows a blended surface in as many texels as it stops light, which VPLs average over. Single pixels
would show the texels, so direct light has maps of its own.
"""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_context import check_errors, create_depth_texture
from vpltune.renderer.gpu.render_targets import ReflectiveShadowMap
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.scene_program import SceneProgram, scene_programs

SHADOW_READS = ("shadow_depth", "shadow_passing")
"""What a program declares that includes `common/shadow.glsl` with `HAS_BLENDED`."""


class BlendedShadowPass(FramePass):
    """Scene, light faces → depth of what stops all light, and the share that passes what lies before it.

    Takes 20 bytes for each texel of the RSM.
    """

    name = "blended_shadow"

    def __init__(self, resources: Resources, scene: SceneBuffers, rsm: ReflectiveShadowMap):
        self._context = resources.context
        self._rsm = rsm
        depth = create_depth_texture(self._context, rsm.depth.size)
        passing = self._context.texture(rsm.depth.size, 4, dtype="f4")
        passing.filter = (moderngl.NEAREST, moderngl.NEAREST)
        resources["shadow_depth"], resources["shadow_passing"] = depth, passing
        self._framebuffer = self._context.framebuffer([passing], depth)
        check_errors(self._context, "shadow maps of blended surfaces")
        reads, shader = ("lights", "rsm_faces"), "reflective_shadow_map/blended_shadow"
        self._wholly = scene_programs(resources, scene, shader, reads, {"PARTLY": 0})
        self._partly = SceneProgram(
            resources, scene, shader, opaque=False, defines={"PARTLY": 1}, reads=reads
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Fill both maps, a tile for each face."""
        context, framebuffer = self._context, self._framebuffer
        framebuffer.use()
        framebuffer.clear(1.0, 1.0, 1.0, 1.0, depth=0.0)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        framebuffer.color_mask = (False, False, False, False)
        for program in self._wholly:
            self._draw_faces(program)
        framebuffer.color_mask = (True, True, True, True)
        framebuffer.depth_mask = False
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        # The least depth, and the product of the shares: neither depends on the order of the surfaces.
        # moderngl takes one of each for colour and one for alpha; its stubs know of one alone.
        context.blend_equation = moderngl.MIN, moderngl.FUNC_ADD
        factors = moderngl.ONE, moderngl.ONE, moderngl.ZERO, moderngl.SRC_ALPHA
        context.blend_func = factors  # pyright: ignore[reportAttributeAccessIssue]
        self._draw_faces(self._partly)
        context.blend_equation = moderngl.FUNC_ADD  # pyright: ignore[reportAttributeAccessIssue]
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        context.enable_only(moderngl.DEPTH_TEST)
        framebuffer.depth_mask = True
        framebuffer.viewport = (0, 0, *self._rsm.depth.size)
        framebuffer.scissor = (0, 0, *self._rsm.depth.size)

    def _draw_faces(self, program: SceneProgram) -> None:
        program.bind()
        for face in range(self._rsm.face_count):
            self._framebuffer.viewport = self._framebuffer.scissor = self._rsm.tile(face)
            program.draw(face_index=face)
