// VPLs: points of the table warped to the density over RSM texels, by inverting first the marginal over
// rows, then the conditional along the row. No value leaves the GPU.
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
uniform vec2 table_rotation;  // Cranley and Patterson (1976)

const VirtualPointLight NO_VPL = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));

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

// A VPL at a texel, with flux and area of the RSM_FILTERING² texels around it, of its face, in the mean: so that
// it has the colour of its surroundings, not that of a speckle which the light's next move replaces. Weighted by
// the chance of each, sum(flux) / sum(weight) keeps the energy: among texels of one chance it is the plain mean.
VirtualPointLight texel_vpl(ivec2 texel, vec2 within) {
    RsmTexel surface = rsm_texel(texel);
    if (!(mean_flux(surface.flux) > 0.0)) {
        return NO_VPL; // rounding of the sums may find a dark texel beside a lit one
    }
    const int reach = RSM_FILTERING / 2;
    ivec2 tile_low = texel / RSM_RESOLUTION * RSM_RESOLUTION;
    ivec2 low = max(texel - reach, tile_low);
    ivec2 high = min(texel + reach, tile_low + RSM_RESOLUTION - 1);
    float weight = 0.0;
    float area = 0.0;
    vec3 flux = vec3(0.0);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            RsmTexel near = rsm_texel(ivec2(x, y));
            float near_flux = mean_flux(near.flux);
            if (near_flux > 0.0) {
                weight += sampling_weight(ivec2(x, y), near_flux);
                area += near.area;
                flux += near.flux;
            }
        }
    }
    // N · p, with p = weight / total_weight the chance of all these texels in one draw.
    float draws = float(vpl_count) * weight / total_weight;
    area /= draws;
#if RSM_FILTERING > 1
    // What the inversion leaves over of the table's point is the place in the texel: as light or density shift,
    // a VPL slides where it would jump from centre to centre.
    surface.position_world = rsm_position_on_plane(surface, vec2(texel) + within);
#endif
    return VirtualPointLight(
        vec4(surface.position_world, sqrt(area / PI)), vec4(surface.normal_world, area), vec4(flux / draws, 0.0));
}

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= vpl_count) {
        return;
    }
    VirtualPointLight vpl = NO_VPL;
    if (total_weight > 0.0) {
        int columns = rsm_columns * RSM_RESOLUTION;
        vec2 target = fract(point_table[index] + table_rotation);
        target.y *= total_weight;
        int row = row_above(target.y);
        int row_start = row * columns;
        target.x *= row_cdf[row_start + columns - 1];
        int column = column_above(row, columns, target.x);
        vec2 low = vec2(column > 0 ? row_cdf[row_start + column - 1] : 0.0, row > 0 ? marginal_cdf[row - 1] : 0.0);
        vec2 high = vec2(row_cdf[row_start + column], marginal_cdf[row]);
        // The maximum guards the quotient where rounding finds a texel of no weight.
        vec2 within = clamp((target - low) / max(high - low, vec2(1e-30)), 0.0, 1.0);
        vpl = texel_vpl(ivec2(column, row), within);
    }
    virtual_point_lights[index] = vpl;
}
