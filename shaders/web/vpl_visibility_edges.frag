// Web page, visibility maps, part 2: marks a texel at a concave corner, or replaces it by the index of its block where a
// silhouette runs through it.
//
// Reads: maps as cast. Writes: maps. Runtime: vpl_visibility_maps/vpl_visibility_edges.comp.
#include "common/virtual_point_lights.glsl"
#include "web/scene_length.glsl"
#include "web/visibility_atlas.glsl"

const int SIZE = VISIBILITY_MAP_SIZE, TEXELS = SIZE * SIZE;
int map_start;
#define SILHOUETTE_ENTRY(texel) VISIBILITY_MAP_ENTRY(map_start + texel.y * SIZE + texel.x)
#include "common/visibility_silhouette.glsl"

uniform int vpl_count;
uniform float longest;

layout(location = 0) out uvec2 out_texel;

void main() {
    int index = int(gl_FragCoord.y) * DATA_COLUMNS + int(gl_FragCoord.x);
    out_texel = VISIBILITY_MAP_ENTRY(index);
    if (index < vpl_count * TEXELS) {
        map_start = index - index % TEXELS;
        ivec2 texel = ivec2(index % SIZE, (index % TEXELS) / SIZE);
        float farthest = VISIBILITY_FARTHEST * longest / measured_scene_length();
        out_texel.x |= corner_mark(texel, farthest);
#if VISIBILITY_MAP_REFINEMENT > 1
        if (is_silhouette(texel, farthest)) {
            out_texel = visibility_block(uint(index));
        }
#endif
    }
}
