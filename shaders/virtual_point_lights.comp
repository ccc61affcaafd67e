// VPLs: points of the table warped to the density over RSM texels, by inverting first the marginal over
// rows, then the conditional along the row. No value leaves the GPU.
#include "common/rsm.glsl"
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
uniform float density_exponent;
uniform vec2 table_rotation;  // Cranley and Patterson (1976)

// First index whose running sum exceeds `target`.
int row_above(float target) {
    int low = 0;
    int high = rows - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (marginal_cdf[middle] > target) { high = middle; } else { low = middle + 1; }
    }
    return low;
}

int column_above(int row, int columns, float target) {
    int low = 0;
    int high = columns - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (row_cdf[row * columns + middle] > target) { high = middle; } else { low = middle + 1; }
    }
    return low;
}

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= vpl_count) {
        return;
    }
    VirtualPointLight vpl = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));
    if (total_weight > 0.0) {
        int columns = rsm_columns * RSM_RESOLUTION;
        vec2 point = fract(point_table[index] + table_rotation);
        int row = row_above(point.y * total_weight);
        float row_total = row_cdf[row * columns + columns - 1];
        int column = column_above(row, columns, point.x * row_total);
        RsmTexel texel = rsm_texel(ivec2(column, row));
        float texel_flux = mean_flux(texel.flux);
        if (texel_flux > 0.0) {
            // N · p, with p = weight / total_weight the chance of this texel in one draw.
            float draws = float(vpl_count) * pow(texel_flux, density_exponent) / total_weight;
            float area = texel.area / draws;
            vpl.position_footprint = vec4(texel.position_world, sqrt(area / PI));
            vpl.normal_area = vec4(texel.normal_world, area);
            vpl.flux = vec4(texel.flux / draws, 0.0);
        }
    }
    virtual_point_lights[index] = vpl;
}
