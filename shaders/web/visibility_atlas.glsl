// Visibility maps one after another in the rows of a texture, and in the place of each of their texels a block of
// finer ones in another.
uniform usampler2D visibility_atlas;
uniform usampler2D visibility_details;

#define VISIBILITY_MAP_ENTRY(index) \
    texelFetch(visibility_atlas, ivec2((index) % DATA_COLUMNS, (index) / DATA_COLUMNS), 0).rg
#define VISIBILITY_DETAIL_ENTRY(block, inside) \
    texelFetch(visibility_details, \
        ivec2(int(block) % DATA_COLUMNS, int(block) / DATA_COLUMNS) * VISIBILITY_MAP_REFINEMENT + inside, 0).rg
#include "common/vpl_visibility.glsl"
