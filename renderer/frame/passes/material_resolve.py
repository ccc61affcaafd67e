"""Material resolve: irradiance and albedo to radiance towards the eye."""

from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import pixel_groups
from vpltune.renderer.gpu.resources import Resources


class MaterialResolvePass:
    """G-buffer albedo and emission, direct and indirect irradiance → radiance; behind all, the sky."""

    name = "material_resolve"

    def __init__(self, resources: Resources, *, glows: bool, shows_sky: bool):
        self._groups = pixel_groups(resources.texture("radiance"))
        self._program = ComputeProgram(
            resources,
            "display/material_resolve",
            {**({"GLOWS": 1} if glows else {}), **({"SHOWS_SKY": 1} if shows_sky else {})},
            reads=(
                "gbuffer_albedo",
                "direct_irradiance",
                "indirect_irradiance",
                *(("gbuffer_emission",) if glows else ()),
                *(("environment_map",) if shows_sky else ()),
            ),
            writes=("radiance",),
        )

    def draw(self, share: tuple[float, float], camera: CameraUniforms) -> None:
        """`share` weighs direct and indirect light: (1, 1) is the full image."""
        self._program.dispatch(*self._groups, share=share, **camera.uniforms)
