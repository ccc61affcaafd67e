// Virtual point lights, part 3: draws VPLs from the density over RSM texels, at the points of a table.
//
// Reads: the RSM, the running sums of parts 1 and 2, frame statistics, importance factors, the point table.
// Writes: VPLs. One invocation for each VPL. Nothing is read back to the CPU.
// Constants: RSM_RESOLUTION, RSM_FILTERING, IMPORTANCE_CELLS.
// Python: renderer/frame/passes/virtual_point_lights.py.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"
#include "common/scene_length.glsl"
#include "common/point_table.glsl"
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = ROW_CDF_BINDING) readonly buffer RowCdf {
    float row_cdf[];
};

layout(std430, binding = MARGINAL_CDF_BINDING) readonly buffer MarginalCdf {
    float marginal_cdf[];
};

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) writeonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int vpl_count;
uniform int rows;
uniform vec2 table_rotation;  // shifts the table on its torus, in [0, 1)² (Cranley and Patterson 1976)

float sum_in_row(int row, int column) {
    return row_cdf[row * rsm_columns * RSM_RESOLUTION + column];
}

float sum_of_rows(int row) {
    return marginal_cdf[row];
}

#include "common/vpl_placement.glsl"

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index < vpl_count) {
        virtual_point_lights[index] = placed_vpl(fract(point_table[index] + table_rotation));
    }
}
