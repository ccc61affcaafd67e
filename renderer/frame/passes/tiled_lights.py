"""Tiled lights (Andersson 2009; Harada 2012): compute shaders that give each tile of pixels its own lights.

Lights are culled twice, against cells of tiles and then against tiles: with 100,000 lights each tile looks
only at those that reach its cell, one bit each.
"""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, create_light_accumulation_target
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms
from vpltune.renderer.scene.dynamic_lights import MIN_DISTANCE, DynamicLights

TILE_SIZE = 16
CELL_TILES = 4
GROUP_SIZE = 256
CULL_BATCH = 2048
"""Lights that one workgroup tests against one cell."""
TILE_BATCH = 8192
"""Lights whose bits one tile holds in shared memory at a time: 1 KiB."""
_TILE_BYTES = 16


class TiledLightsPass:
    """G-buffer, lights → light accumulation, in three dispatches."""

    def __init__(self, context: moderngl.Context, gbuffer: GBuffer):
        self._context = context
        self._gbuffer = gbuffer
        self.light_accumulation = create_light_accumulation_target(context, gbuffer.depth.size)
        defines = {
            **buffer_bindings.DEFINES,
            "MIN_DISTANCE": MIN_DISTANCE,
            "TILE_SIZE": TILE_SIZE,
            "CELL_TILES": CELL_TILES,
            "GROUP_SIZE": GROUP_SIZE,
            "CULL_BATCH": CULL_BATCH,
            "TILE_BATCH": TILE_BATCH,
        }
        self._depth = load_compute(context, "dynamic_lights/tiled_lights_depth", defines)
        self._cull = load_compute(context, "dynamic_lights/tiled_lights_cull", defines)
        self._shade = load_compute(context, "dynamic_lights/tiled_lights", defines)
        width, height = gbuffer.depth.size
        self._tile_count = (-(-width // TILE_SIZE), -(-height // TILE_SIZE))
        self._cell_count = tuple(-(-count // CELL_TILES) for count in self._tile_count)
        self._tiles = context.buffer(reserve=self._tile_count[0] * self._tile_count[1] * _TILE_BYTES)
        self._cells: moderngl.Buffer | None = None

    def draw(self, camera: CameraUniforms, lights: DynamicLights) -> None:
        """Accumulate the lights that are bound."""
        context = self._context
        self._tiles.bind_to_storage_buffer(buffer_bindings.LIGHT_TILES)
        self._bind_cells(len(lights))
        for program in (self._depth, self._cull, self._shade):
            camera.bind_gbuffer(program, self._gbuffer, 0)
            set_uniforms(program, light_count=len(lights))
        self._depth.run(*self._tile_count)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        set_uniforms(self._cull, tile_count=self._tile_count)
        self._cull.run(*self._cell_count, -(-len(lights) // CULL_BATCH))
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        set_uniforms(
            self._shade, cell_columns=self._cell_count[0], accumulation_unit=lights.accumulation_unit
        )
        self.light_accumulation.bind_to_image(0, read=False, write=True)
        self._shade.run(*self._tile_count)
        context.memory_barrier(context.TEXTURE_FETCH_BARRIER_BIT)

    def _bind_cells(self, light_count: int) -> None:
        """One bit for each light and cell; a new buffer only where there are more lights than ever."""
        size = self._cell_count[0] * self._cell_count[1] * -(-light_count // 32) * 4
        if self._cells is None or self._cells.size < size:
            self._cells = self._context.buffer(reserve=size)
        self._cells.bind_to_storage_buffer(buffer_bindings.LIGHT_CELLS)
