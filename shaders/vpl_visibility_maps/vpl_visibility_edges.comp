// Visibility maps, part 3: marks the texels at concave corners, finds those at silhouettes, lists them, and writes the
// indices of their blocks into the maps, all for texels that a receiver may look up. One workgroup for each VPL.
//
// Reads: `visibility_marks`. Reads and writes: `visibility_maps`. Writes: the list of texels.
// Constants: VISIBILITY_BLOCKS, the number of blocks that there is room for. Further silhouettes stay coarse.
// FEW_LOOKED_UP of renderer/frame/visibility_map_layout.py.
// Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"

// 32 KiB for the largest maps (64² texels): every driver has that much shared memory.
const int TEXELS = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;
shared uvec2 whole_map[TEXELS];  // a copy as cast: other invocations overwrite entries of the map itself
#define SILHOUETTE_ENTRY(texel) whole_map[texel.y * VISIBILITY_MAP_SIZE + texel.x]
#include "common/visibility_silhouette.glsl"
#include "common/visibility_edges.glsl"
#include "common/visibility_marks.glsl"
#include "common/visibility_workgroup.glsl"

layout(local_size_x = 64) in;

uniform float longest;  // the scene's diagonal [world units]

void main() {
    int vpl_index = workgroup_vpl();
    if (vpl_index >= vpl_count) {
        return;
    }
    int start = vpl_index * TEXELS;
    for (int i = int(gl_LocalInvocationIndex); i < TEXELS; i += 64) {
        whole_map[i] = visibility_maps[start + i];
    }
    barrier();
    bool few_looked_up = marked_texels(vpl_index) <= FEW_LOOKED_UP;
    float farthest = VISIBILITY_FARTHEST * longest / scene_length;
    for (int i = int(gl_LocalInvocationIndex); i < TEXELS; i += 64) {
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
        if (!is_marked(vpl_index, texel, 0)) {
            continue;
        }
        visibility_maps[start + i].x |= corner_mark(texel, farthest);
#if VISIBILITY_BLOCKS > 0
        if (!few_looked_up && !is_silhouette(texel, farthest)) {
            continue;
        }
        uint block = atomicAdd(visibility_edge_count, 1u);
        if (block < uint(VISIBILITY_BLOCKS)) {
            visibility_edges[block] = uint(start + i);
            visibility_maps[start + i] = visibility_block(block);
            uint groups = ((block + 1u) * uint(VISIBILITY_BLOCK_TEXELS) + 63u) / 64u;
            atomicMax(visibility_edge_groups[0], min(groups, uint(MOST_WORKGROUPS)));
        }
#endif
    }
}
