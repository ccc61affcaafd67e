// Web page: the visibility maps in textures. One texture holds all maps one after another, in rows of DATA_COLUMNS
// texels; another holds, for each of those texels, room for a block of finer texels.
//
// Provides: all of common/vpl_visibility.glsl. Constants: DATA_COLUMNS of renderer/export/web_page/web_page.py.
uniform usampler2D visibility_atlas;
uniform usampler2D visibility_details;

#define VISIBILITY_MAP_ENTRY(index) \
    texelFetch(visibility_atlas, ivec2((index) % DATA_COLUMNS, (index) / DATA_COLUMNS), 0).rg
#define VISIBILITY_DETAIL_ENTRY(block, inside) \
    texelFetch(visibility_details, \
        ivec2(int(block) % DATA_COLUMNS, int(block) / DATA_COLUMNS) * VISIBILITY_MAP_REFINEMENT + inside, 0).rg
#include "common/vpl_visibility.glsl"
