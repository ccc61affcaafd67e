"""Material resolve: irradiance and albedo to radiance towards the eye."""

from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import pixel_groups
from vpltune.renderer.gpu.resources import Resources


class MaterialResolvePass:
    """G-buffer albedo, direct and indirect irradiance → radiance."""

    name = "material_resolve"

    def __init__(self, resources: Resources):
        self._groups = pixel_groups(resources.texture("radiance"))
        self._program = ComputeProgram(
            resources,
            "display/material_resolve",
            reads=("gbuffer_albedo", "direct_irradiance", "indirect_irradiance"),
            writes=("radiance",),
        )

    def draw(self, share: tuple[float, float]) -> None:
        """`share` weighs direct and indirect light: (1, 1) is the full image."""
        self._program.dispatch(*self._groups, share=share)
