"""Tiled lights (Andersson 2009; Harada 2012): compute shaders that give each tile of pixels its own lights.

Lights are culled twice, against cells of tiles and then against tiles: with 100,000 lights each tile looks
only at those that reach its cell, one bit each.
"""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, create_light_accumulation_target
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.dynamic_lights import MIN_DISTANCE

TILE_SIZE = 16
"""Pixels along the side of a tile. A choice, as are the next three."""
CELL_TILES = 4
"""Tiles along the side of a cell."""
GROUP_SIZE = 256
"""Invocations of a workgroup that culls lights."""
CULL_BATCH = 2048
"""Lights that one workgroup tests against one cell."""
TILE_BATCH = 8192
"""Lights whose bits one tile holds in shared memory at a time: 1 KiB."""
_TILE_BYTES = 16
"""Bytes of a `LightTile` in shaders/common/light_culling.glsl."""


class TiledLightsPass:
    """G-buffer, lights → light accumulation, in three dispatches."""

    accumulation = "tiled_light_accumulation"
    """The resource that it writes."""

    def __init__(self, resources: Resources):
        self._resources = resources
        context, (width, height) = resources.context, resources.texture("gbuffer_depth").size
        self._tile_count = (-(-width // TILE_SIZE), -(-height // TILE_SIZE))
        self._cell_count = tuple(-(-count // CELL_TILES) for count in self._tile_count)
        self._cells: moderngl.Buffer | None = None
        resources[self.accumulation] = create_light_accumulation_target(context, (width, height))
        tiles = self._tile_count[0] * self._tile_count[1]
        resources["light_tiles"] = context.buffer(reserve=tiles * _TILE_BYTES)
        defines = {
            "MIN_DISTANCE": MIN_DISTANCE,
            "TILE_SIZE": TILE_SIZE,
            "CELL_TILES": CELL_TILES,
            "GROUP_SIZE": GROUP_SIZE,
            "CULL_BATCH": CULL_BATCH,
            "TILE_BATCH": TILE_BATCH,
        }

        def program(stage: str, reads: tuple[str, ...], writes: str) -> ComputeProgram:
            return ComputeProgram(
                resources,
                f"dynamic_lights/tiled_lights{stage}",
                defines,
                reads=(*GBUFFER_READS, "dynamic_lights", *reads),
                writes=(writes,),
            )

        self._depth = program("_depth", ("light_cells",), "light_tiles")
        self._cull = program("_cull", ("light_tiles",), "light_cells")
        self._shade = program("", ("light_tiles", "light_cells"), f"{self.accumulation} as accumulation")

    def draw(self, inputs: FrameInputs) -> None:
        """Accumulate the lights."""
        lights = inputs.dynamic_lights
        assert lights is not None, "a pre-pass without lights draws nothing"
        self._make_room(len(lights))
        uniforms = {**inputs.camera.uniforms, "light_count": len(lights)}
        self._depth.dispatch(*self._tile_count, **uniforms)
        self._cull.dispatch(
            *self._cell_count, -(-len(lights) // CULL_BATCH), **uniforms, tile_count=self._tile_count
        )
        self._shade.dispatch(
            *self._tile_count,
            **uniforms,
            cell_columns=self._cell_count[0],
            accumulation_unit=lights.accumulation_unit,
        )

    def _make_room(self, light_count: int) -> None:
        """One bit for each light and cell; a new buffer only where there are more lights than ever."""
        size = self._cell_count[0] * self._cell_count[1] * -(-light_count // 32) * 4
        if self._cells is None or self._cells.size < size:
            self._cells = self._resources["light_cells"] = self._resources.context.buffer(reserve=size)
