// Finds the texels of visibility maps that are to be cast finer: those where what one texel met would shade what
// a neighbour met. There a silhouette runs through, and one ray says too little; a corner of a room or an edge of
// a box that the VPL looks at hides nothing, and stays coarse. One workgroup for each VPL.
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"
#include "common/vpl_visibility.glsl"
#include "common/visibility_edges.glsl"

layout(local_size_x = 64) in;

uniform float longest;  // the scene's diagonal [world units]

const int TEXELS = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;
// Overlap beyond which one surface hides another, of the distance: the bias that a lookup has by default.
const float LEAST_OVERLAP = 2e-3;

shared uvec2 map[TEXELS];

bool hides(MetSurface nearer, MetSurface farther) {
    // Nothing, which lies two diagonals away, is never hidden: no receiver is there.
    return length(farther.end) < 1.5 * longest / scene_length
        && surface_overlap(nearer, farther.end, farther.normal) > LEAST_OVERLAP;
}

bool is_edge(ivec2 texel) {
    MetSurface own = met_surface(map[texel.y * VISIBILITY_MAP_SIZE + texel.x], texel, VISIBILITY_MAP_SIZE);
    for (int y = max(texel.y - 1, 0); y <= min(texel.y + 1, VISIBILITY_MAP_SIZE - 1); ++y) {
        for (int x = max(texel.x - 1, 0); x <= min(texel.x + 1, VISIBILITY_MAP_SIZE - 1); ++x) {
            MetSurface other = met_surface(map[y * VISIBILITY_MAP_SIZE + x], ivec2(x, y), VISIBILITY_MAP_SIZE);
            if (hides(own, other) || hides(other, own)) {
                return true;
            }
        }
    }
    return false;
}

void main() {
    int start = int(gl_WorkGroupID.x) * TEXELS;
    for (int i = int(gl_LocalInvocationIndex); i < TEXELS; i += 64) {
        map[i] = visibility_maps[start + i];
    }
    barrier();
    for (int i = int(gl_LocalInvocationIndex); i < TEXELS; i += 64) {
        if (!is_edge(ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE))) {
            continue;
        }
        uint block = atomicAdd(visibility_edge_count, 1u);
        if (block < uint(VISIBILITY_BLOCKS)) {
            visibility_edges[block] = uint(start + i);
            visibility_maps[start + i] = visibility_block(block);
            uint groups = ((block + 1u) * uint(VISIBILITY_BLOCK_TEXELS) + 63u) / 64u;
            atomicMax(visibility_edge_groups[0], min(groups, MOST_GROUPS));
        }
    }
}
