// Visibility maps one after another in the rows of a texture.
uniform usampler2D visibility_atlas;

#define VISIBILITY_MAP_ENTRY(index) \
    texelFetch(visibility_atlas, ivec2((index) % DATA_COLUMNS, (index) / DATA_COLUMNS), 0).rg
#include "common/vpl_visibility.glsl"
