// Web page, visibility maps, part 1: casts one texel of a VPL's map.
//
// Reads: VPLs, ray tree, moments. Writes: maps. Runtime: vpl_visibility_maps/vpl_visibility_maps.comp.
#include "web/visibility_ray.glsl"

layout(location = 0) out uvec2 out_texel;

void main() {
    const int size = VISIBILITY_MAP_SIZE, texels = size * size;
    int index = int(gl_FragCoord.y) * DATA_COLUMNS + int(gl_FragCoord.x);
    out_texel = uvec2(0u);
    if (index < vpl_count * texels) {
        ivec2 texel = ivec2(index % size, (index % texels) / size);
        out_texel = cast_visibility_texel(vpl_at(index / texels), visibility_axis(texel, size));
    }
}
