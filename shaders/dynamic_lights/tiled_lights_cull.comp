// Tiled lights, part 2: lights against light-culling cells of CELL_TILES x CELL_TILES tiles.
//
// Reads: tiles, dynamic lights. Writes: for each cell, one bit for each light that may reach it.
// One workgroup for each cell and each batch of CULL_BATCH lights.
// Constants: TILE_SIZE, CELL_TILES, GROUP_SIZE and CULL_BATCH of renderer/frame/passes/tiled_lights.py.
#include "common/light_culling.glsl"

layout(local_size_x = GROUP_SIZE) in;

uniform ivec2 tile_count;

shared uint nearest_bits;  // positive floats have the order of their bits
shared uint farthest_bits;
shared uint words[CULL_BATCH / 32];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    ivec2 first_tile = ivec2(gl_WorkGroupID.xy) * CELL_TILES;
    ivec2 end_tile = min(first_tile + CELL_TILES, tile_count);
    if (lane == 0) {
        nearest_bits = 0x7f7fffffu;  // the largest float32
        farthest_bits = 0u;
    }
    if (lane < CULL_BATCH / 32) {
        words[lane] = 0u;
    }
    barrier();
    ivec2 tile = first_tile + ivec2(lane % CELL_TILES, lane / CELL_TILES);
    if (all(lessThan(tile, end_tile))) {
        LightTile seen = light_tiles[tile.y * tile_count.x + tile.x];
        atomicMin(nearest_bits, floatBitsToUint(seen.nearest));
        atomicMax(farthest_bits, floatBitsToUint(seen.farthest));
    }
    barrier();
    vec2 image_size = vec2(textureSize(gbuffer_depth, 0));
    ViewBlock cell = view_block(vec2(first_tile * TILE_SIZE), vec2(end_tile * TILE_SIZE), image_size,
                                uintBitsToFloat(nearest_bits), uintBitsToFloat(farthest_bits));
    int start = int(gl_WorkGroupID.z) * CULL_BATCH;
    if (cell.nearest <= cell.farthest) {
        for (int i = lane; i < min(CULL_BATCH, light_count - start); i += GROUP_SIZE) {
            if (light_reaches(dynamic_lights[start + i], cell)) {
                atomicOr(words[i / 32], 1u << (i % 32));
            }
        }
    }
    barrier();
    int words_per_cell = (light_count + 31) / 32;
    int word = start / 32 + lane;
    if (lane < CULL_BATCH / 32 && word < words_per_cell) {
        uint cell_index = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
        light_cells[cell_index * words_per_cell + word] = words[lane];
    }
}
