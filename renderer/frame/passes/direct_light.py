"""Direct light: the light pre-pass's sum, and the punctual lights with shadows from their RSMs."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import (
    GBUFFER_READS,
    RSM_READS,
    ReflectiveShadowMap,
    pixel_groups,
)
from vpltune.renderer.gpu.resources import Resources


class DirectLightPass(FramePass):
    """G-buffer, RSM, light accumulation → irradiance of the punctual lights, in the texture `target`.

    `along_rays` lights are left out, the last ones: parts of a sky. `shadow_reads` names the shadow maps of a
    scene with blended surfaces.
    """

    name = "direct_light"

    def __init__(
        self,
        resources: Resources,
        rsm: ReflectiveShadowMap,
        target: str,
        along_rays: int = 0,
        shadow_reads: tuple[str, ...] = (),
    ):
        self._rsm = rsm
        self._along_rays = along_rays
        self._groups = pixel_groups(resources.texture(target))
        self._program = ComputeProgram(
            resources,
            "direct_light/direct_light",
            {"RSM_RESOLUTION": rsm.resolution, **({"HAS_BLENDED": 1} if shadow_reads else {})},
            reads=(*GBUFFER_READS, *RSM_READS, *shadow_reads, "light_accumulation"),
            writes=(f"{target} as irradiance",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Shade every pixel."""
        self._program.dispatch(
            *self._groups,
            **inputs.camera.uniforms,
            **self._rsm.uniforms,
            light_count=inputs.light_count - self._along_rays,
            accumulation_unit=inputs.accumulation_unit,
        )
