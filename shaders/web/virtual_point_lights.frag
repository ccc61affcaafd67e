// Web page: draws one VPL, or one RSM sample, for each texel of three targets, VPL_COLUMNS in a row.
//
// Reads: the RSM, running sums, importance, the point table. Writes: VPLs.
// Runtime: virtual_point_lights/virtual_point_lights.comp.
#include "common/rsm.glsl"
#include "common/virtual_point_lights.glsl"
#include "web/vpl_sums.glsl"
#include "common/vpl_placement.glsl"

uniform sampler2D point_table;

layout(location = 0) out vec4 out_position_footprint;
layout(location = 1) out vec4 out_normal_area;
layout(location = 2) out vec4 out_flux;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    VirtualPointLight vpl = NO_VPL;
    if (texel.y * VPL_COLUMNS + texel.x < vpl_count) {
        vpl = placed_vpl(texelFetch(point_table, texel, 0).rg);
    }
    out_position_footprint = vpl.position_footprint;
    out_normal_area = vpl.normal_area;
    out_flux = vpl.flux;
}
