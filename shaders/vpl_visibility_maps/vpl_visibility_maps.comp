// Visibility maps, part 1: casts one ray for each texel of each VPL's hemispherical map. One workgroup for each VPL.
//
// Reads: VPLs, scene length, ray hierarchy. Writes: `visibility_maps`.
// Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/visibility_ray.glsl"
#include "common/visibility_workgroup.glsl"

layout(local_size_x = 64) in;

void main() {
    int vpl_index = workgroup_vpl();
    if (vpl_index >= vpl_count) {
        return;
    }
    VirtualPointLight vpl = virtual_point_lights[vpl_index];
    const int texels = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;
    for (int i = int(gl_LocalInvocationIndex); i < texels; i += 64) {
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
        visibility_maps[vpl_index * texels + i] =
            cast_visibility_texel(vpl, visibility_axis(texel, VISIBILITY_MAP_SIZE));
    }
}
