// Visibility maps, part 4: at silhouettes, VISIBILITY_MAP_REFINEMENT² finer rays for each listed texel.
//
// Reads: the list of texels, VPLs, ray hierarchy. Writes: `visibility_details`.
// Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/visibility_ray.glsl"
#include "common/visibility_edges.glsl"

layout(local_size_x = 64) in;

void main() {
    const int size = VISIBILITY_MAP_SIZE, refinement = VISIBILITY_MAP_REFINEMENT, texels = size * size;
    uint end = min(visibility_edge_count, uint(VISIBILITY_BLOCKS)) * uint(VISIBILITY_BLOCK_TEXELS);
    for (uint i = gl_GlobalInvocationID.x; i < end; i += gl_NumWorkGroups.x * 64u) {
        int edge = int(visibility_edges[i / uint(VISIBILITY_BLOCK_TEXELS)]);
        int place = int(i % uint(VISIBILITY_BLOCK_TEXELS));
        ivec2 coarse = ivec2(edge % size, edge % texels / size);
        ivec2 texel = coarse * refinement + ivec2(place % refinement, place / refinement);
        VirtualPointLight vpl = virtual_point_lights[edge / texels];
#ifdef RAYS_MEET_HOLES
        // Not a seed of the coarse maps, and not dependent on the order of the blocks.
        ray_seed = hashed(uint(edge)) + uint(place);
#endif
        visibility_details[i] = cast_visibility_texel(vpl, visibility_axis(texel, size * refinement));
    }
}
