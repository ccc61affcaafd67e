// Web page, VPL importance, part 1: summarises the RSM in importance cells, laid out as its faces are.
//
// Reads: the RSM. Writes: importance cells. Runtime: vpl_importance/vpl_importance_cells.comp.
#include "common/rsm.glsl"
#include "common/vpl_importance_form.glsl"
#include "common/vpl_importance_cell.glsl"

layout(location = 0) out vec4 out_position_flux;
layout(location = 1) out vec4 out_normal_area;

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    ivec2 tile = place / IMPORTANCE_CELLS;
    ImportanceCell cell = importance_cell(tile.y * rsm_columns + tile.x, place - tile * IMPORTANCE_CELLS);
    out_position_flux = cell.position_flux;
    out_normal_area = cell.normal_area;
}
