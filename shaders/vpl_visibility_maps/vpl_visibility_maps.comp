// Visibility maps, part 2: casts one ray for each marked texel of each VPL's hemispherical map, and for the neighbours
// that tell whether it is at a corner or a silhouette. One workgroup for each VPL.
//
// Reads: VPLs, scene length, ray hierarchy, `visibility_marks`. Writes: `visibility_maps`.
// Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/visibility_ray.glsl"
#include "common/visibility_marks.glsl"
#include "common/visibility_workgroup.glsl"

layout(local_size_x = 64) in;

const int TEXELS = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;

shared int wanted[TEXELS];
shared int wanted_count;

void main() {
    int vpl_index = workgroup_vpl();
    if (vpl_index >= vpl_count) {
        return;
    }
    int lane = int(gl_LocalInvocationIndex);
    if (lane == 0) {
        wanted_count = 0;
    }
    barrier();
    // A list, so that no invocation waits for the rays of others.
    for (int i = lane; i < TEXELS; i += 64) {
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
        if (is_marked(vpl_index, texel, 1)) {
            wanted[atomicAdd(wanted_count, 1)] = i;
        } else {
            visibility_maps[vpl_index * TEXELS + i] = visibility_nothing(visibility_axis(texel, VISIBILITY_MAP_SIZE));
        }
    }
    barrier();
    VirtualPointLight vpl = virtual_point_lights[vpl_index];
    for (int k = lane; k < wanted_count; k += 64) {
        int i = wanted[k];
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
#ifdef RAYS_MEET_HOLES
        ray_seed = uint(vpl_index * TEXELS + i);
#endif
        visibility_maps[vpl_index * TEXELS + i] =
            cast_visibility_texel(vpl, visibility_axis(texel, VISIBILITY_MAP_SIZE));
    }
}
