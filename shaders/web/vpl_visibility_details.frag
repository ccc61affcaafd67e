// Web page, visibility maps, part 3: one finer texel of a block, where a silhouette runs through the block's texel.
//
// Reads: maps, VPLs, ray tree. Writes: blocks. Runtime: vpl_visibility_maps/vpl_visibility_details.comp.
#include "web/visibility_ray.glsl"

layout(location = 0) out uvec2 out_texel;

void main() {
    const int size = VISIBILITY_MAP_SIZE, refinement = VISIBILITY_MAP_REFINEMENT, texels = size * size;
    ivec2 place = ivec2(gl_FragCoord.xy), block = place / refinement;
    int index = block.y * DATA_COLUMNS + block.x;
    out_texel = uvec2(0u);
    if (index < vpl_count * texels && (VISIBILITY_MAP_ENTRY(index).x & VISIBILITY_BLOCK_BIT) != 0u) {
        ivec2 coarse = ivec2(index % size, (index % texels) / size);
        ivec2 texel = coarse * refinement + place % refinement;
        out_texel = cast_visibility_texel(vpl_at(index / texels), visibility_axis(texel, size * refinement));
    }
}
