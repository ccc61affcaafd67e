"""Sky light: direct light of the sky, along rays that pixels share out among them."""

import numpy as np

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.irradiance_filter import IrradianceFilter
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.render_targets import EMPTY_DISPATCH, GBUFFER_READS, pixel_groups
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.sky_lights import TEXEL, SkyLights

LARGEST_BLOCK = 8
"""Pixels along the side of a block that shares the rays out, at most. A choice: 1,024 rays are then 16 a
pixel."""
MOST_RAYS = 1 << 22
"""Rays of a frame whose blocks are smaller. A choice: about what a frame of 640×360 casts with the largest
block."""
LEAST_SHARE = 0.125
"""Share of the pixels of a block: where fewer are on a pixel's surface, the pixel takes as many rays itself.
A choice of 1/4 and 1/8, by the time in a room full of plants and mouldings."""
LISTED_STRIDE = round(1.0 / LEAST_SHARE)
"""From one ray of such a pixel to its next."""
LEAST_RAYS = 12
"""Rays of a pixel, at least: of fewer, all might lie below its horizon. A choice."""
MOST_BITS = 32
"""First rays of a pixel, at most, for tiles to keep which are open: bits of a number."""
REACH = 2
"""Tiles to each side that tell a tile which rays to cast. A choice: 24 tiles of 8 × 8 pixels test each ray 24
times, so that one which passes in a tenth of the places is found in 92 %."""
LIFT = 2e-5
"""A ray starts so far above its surface, in distances from the camera. A choice: the G-buffer's depth has 7
digits."""
LEAST_LIFT = 1e-6
"""And this, in diagonals of the scene: coordinates have 7 digits too. A choice: of 5 km it is 5 mm. With
2e-5, the rays of a floor on such a ground began above what stood on it."""
OPEN_NODES = 33
"""Nodes along the side of the table of irradiance in the open. A choice: 4° apart, so that straight lines
between them err by 0.1 %."""


def block_side(pixels: int, rays: int) -> int:
    """Pixels along the side of a block that shares `rays` out, in a frame of so many: 1, 2, 4 or 8."""
    side = LARGEST_BLOCK
    while side > 1 and pixels * rays <= MOST_RAYS * (side // 2) ** 2:
        side //= 2
    return side


class SkyLightPass(FramePass):
    """G-buffer, ray hierarchy, `lamp_irradiance` → `target`, their sum; `shared_irradiance` in between.

    Pixels whose neighbours are on other surfaces cast rays of their own.

    Rays, and not shadow maps: from 32 directions, light through a window fell on the floor as 32 windows, and
    its squared error was 15 times as large (`tests/physics/test_sky.py`).
    """

    name = "sky_light"

    def __init__(self, resources: Resources, hierarchy: RayHierarchy, sky: SkyLights, target: str):
        self._resources = resources
        self._hierarchy = hierarchy
        self._count = len(sky.ray_flux)
        image = resources.texture(target)
        self._block = block_side(image.width * image.height, self._count)
        self._stride = self._block**2
        while self._stride > 1 and self._count < LEAST_RAYS * self._stride:
            self._stride //= 2
        context = resources.context
        rays = np.concatenate(
            [sky.ray_towards, sky.ray_texels[:, :1], sky.ray_flux, sky.ray_texels[:, 1:]], 1
        )
        resources["sky_rays"] = context.buffer(rays.astype(np.float32).tobytes())
        texels = np.zeros((len(sky.texel_flux), 2, 4), np.float32)
        texels[:, 0, :3], texels[:, 1, :3] = sky.texel_towards, sky.texel_flux
        resources["sky_texels"] = context.buffer(texels.tobytes())
        nodes = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, OPEN_NODES)] * 2), axis=-1).reshape(-1, 2)
        in_the_open = np.zeros((OPEN_NODES**2, 4), np.float32)
        in_the_open[:, :3] = sky.open_irradiance(
            octahedral_decode(nodes.astype(np.float32)).astype(np.float64)
        )
        resources["sky_open"] = context.buffer(in_the_open.tobytes())
        self._groups = pixel_groups(image)
        self._guided = self._stride == LARGEST_BLOCK**2 and self._count <= MOST_BITS * self._stride
        words = -(-self._count // 32)
        defines = {
            **hierarchy.defines,
            "SKY_LIFT": LIFT,
            "SKY_LEAST_LIFT": LEAST_LIFT,
            "SKY_TEXEL": TEXEL,
            "SKY_WORDS": words,
            "SKY_REACH": REACH,
            "SKY_GUIDED": self._guided,
            "OPEN_NODES": OPEN_NODES,
            "BLOCK": self._block,
        }
        rays_read = (*GBUFFER_READS, *hierarchy.reads, "sky_rays", "sky_texels")
        reads = (*rays_read, "sky_open")
        if self._guided:
            self._tiles = -(-image.width // self._block), -(-image.height // self._block)
            tiles = self._tiles[0] * self._tiles[1]
            resources["sky_bits"] = context.buffer(reserve=image.width * image.height * 4)
            resources["sky_probes"] = context.buffer(reserve=tiles * (1 + words) * 4)
            resources["sky_candidates"] = context.buffer(reserve=tiles * (1 + words) * 8)
            self._probes = ComputeProgram(
                resources,
                "sky_light/sky_probes",
                defines,
                reads=rays_read,
                writes=("sky_probes", "sky_bits"),
            )
            self._candidates = ComputeProgram(
                resources,
                "sky_light/sky_candidates",
                defines,
                reads=("sky_probes",),
                writes=("sky_candidates",),
            )
            reads += ("sky_candidates", "sky_bits")
        self._program = ComputeProgram(
            resources,
            "sky_light/sky_light",
            {**defines, "LISTED_PIXELS": False},
            reads=reads,
            writes=("shared_irradiance as irradiance",),
        )
        self._filter = IrradianceFilter(
            resources,
            self._block,
            reads=("shared_irradiance as interleaved", "lamp_irradiance as base"),
            target=target,
            least_share=LEAST_SHARE if self._stride > LISTED_STRIDE else 0.0,
            add_base=True,
        )
        self._listed = ComputeProgram(
            resources,
            "sky_light/sky_light",
            {**defines, "LISTED_PIXELS": True},
            reads=(*reads, "pixel_list", "lamp_irradiance as base"),
            writes=(f"{target} as irradiance",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Cast the rays, and join the pixels' shares."""
        self._hierarchy.update()
        uniforms = {**inputs.camera.uniforms, "longest": inputs.scene_diagonal, "ray_count": self._count}
        if self._guided:
            self._probes.dispatch(*self._tiles, **uniforms, stride=self._stride)
            self._candidates.dispatch(*self._tiles, ray_count=self._count)
        uniforms["probe_stride"] = self._stride
        self._program.dispatch(*self._groups, **uniforms, stride=self._stride)
        self._resources.write("pixel_list", EMPTY_DISPATCH)
        self._filter.draw(inputs)
        # Where rays are few, a pixel takes as many of them from the start.
        if self._stride > LISTED_STRIDE:
            self._listed.dispatch_indirect("pixel_list", **uniforms, stride=LISTED_STRIDE)
