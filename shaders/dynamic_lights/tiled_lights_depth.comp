// Tiled lights, part 1: the range of depths in each tile, and which slices of that range hold a surface.
//
// Reads: G-buffer depth. Writes: tiles. One workgroup for each tile.
// Constants: TILE_SIZE of renderer/frame/passes/tiled_lights.py. Source: Harada 2012 ("2.5D culling").
#include "common/light_culling.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

shared uint nearest_bits;  // positive floats have the order of their bits
shared uint farthest_bits;
shared uint slices;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (gl_LocalInvocationIndex == 0) {
        nearest_bits = 0x7f7fffffu;  // the largest float32
        farthest_bits = 0u;
        slices = 0u;
    }
    barrier();
    float depth = all(lessThan(pixel, textureSize(gbuffer_depth, 0))) ? texelFetch(gbuffer_depth, pixel, 0).r : 0.0;
    float distance_along_axis = near_plane / max(depth, 1e-30);
    if (depth > 0.0) {
        atomicMin(nearest_bits, floatBitsToUint(distance_along_axis));
        atomicMax(farthest_bits, floatBitsToUint(distance_along_axis));
    }
    barrier();
    float nearest = uintBitsToFloat(nearest_bits);
    float farthest = uintBitsToFloat(farthest_bits);
    if (depth > 0.0) {
        atomicOr(slices, 1u << depth_slice(distance_along_axis, nearest, farthest));
    }
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        light_tiles[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] =
            LightTile(nearest, farthest, slices, 0u);
    }
}
