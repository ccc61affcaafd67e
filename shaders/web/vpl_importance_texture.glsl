// Web page: reads importance cells from textures. Provides: `importance_cell_at`.
#include "common/vpl_importance_form.glsl"

uniform sampler2D cell_position_flux;
uniform sampler2D cell_normal_area;

ImportanceCell importance_cell_at(ivec2 texel) {
    return ImportanceCell(texelFetch(cell_position_flux, texel, 0), texelFetch(cell_normal_area, texel, 0));
}
