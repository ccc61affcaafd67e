"""Sky light: direct light of the sky, along rays that pixels share out among them."""

import numpy as np

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.irradiance_filter import IrradianceFilter
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, pixel_groups
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.sky_lights import SkyLights

BLOCK = 8
"""Pixels along the side of a block that shares the rays out. A choice: 1,024 rays are then 16 a pixel."""
LEAST_RAYS = 12
"""Rays of a pixel, at least: of fewer, all might lie below its horizon. A choice."""
LIFT = 2e-5
"""A ray starts so far above its surface, in diagonals of the scene or distances from the camera. A choice:
the G-buffer's depth has 7 digits."""

OPEN_NODES = 33
"""Nodes along the side of the table of irradiance in the open. A choice: 4° apart, so that straight lines
between them err by 0.1 %."""


class SkyLightPass(FramePass):
    """G-buffer, ray hierarchy, `lamp_irradiance` → `target`, their sum; `shared_irradiance` in between.

    Rays, and not shadow maps: from 32 directions, light through a window fell on the floor as 32 windows, and
    its squared error was 15 times as large (`tests/physics/test_sky.py`).
    """

    name = "sky_light"

    def __init__(self, resources: Resources, hierarchy: RayHierarchy, sky: SkyLights, target: str):
        self._hierarchy = hierarchy
        self._count = len(sky.ray_flux)
        self._stride = BLOCK**2
        while self._stride > 1 and self._count < LEAST_RAYS * self._stride:
            self._stride //= 2
        rays = np.zeros((self._count, 2, 4), np.float32)
        rays[:, 0, :3], rays[:, 1, :3] = sky.ray_towards, sky.ray_flux
        resources["sky_rays"] = resources.context.buffer(rays.tobytes())
        nodes = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, OPEN_NODES)] * 2), axis=-1).reshape(-1, 2)
        in_the_open = np.zeros((OPEN_NODES**2, 4), np.float32)
        in_the_open[:, :3] = sky.open_irradiance(
            octahedral_decode(nodes.astype(np.float32)).astype(np.float64)
        )
        resources["sky_open"] = resources.context.buffer(in_the_open.tobytes())
        self._groups = pixel_groups(resources.texture(target))
        self._program = ComputeProgram(
            resources,
            "sky_light/sky_light",
            {**hierarchy.defines, "SKY_LIFT": LIFT, "OPEN_NODES": OPEN_NODES},
            reads=(*GBUFFER_READS, *hierarchy.reads, "sky_rays", "sky_open"),
            writes=("shared_irradiance as irradiance",),
        )
        self._filter = IrradianceFilter(
            resources,
            BLOCK,
            reads=("shared_irradiance as interleaved", "lamp_irradiance as base"),
            target=target,
            add_base=True,
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Cast the rays, and join the pixels' shares."""
        self._hierarchy.update()
        camera = inputs.camera.uniforms
        self._program.dispatch(
            *self._groups, **camera, longest=inputs.scene_diagonal, ray_count=self._count, stride=self._stride
        )
        self._filter.draw(inputs)
