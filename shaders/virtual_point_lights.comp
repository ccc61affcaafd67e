// VPLs: points of the table warped to the density over blocks of RSM texels, by inverting first the marginal
// over rows, then the conditional along the row. No value leaves the GPU.
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

// A block of RSM texels as a VPL that has all of its light. What the inversion leaves over of the table's point,
// `within` in [0, 1)², picks the place: as light or density shift, a VPL slides, where a choice among texels
// would jump.
VirtualPointLight block_vpl(ivec2 block, vec2 within) {
    vec2 place = within * RSM_FILTERING;
    float weight = 0.0;
    float area = 0.0;
    vec3 flux = vec3(0.0);
    RsmTexel surface;
    ivec2 nearest;
    float nearest_distance = RSM_FILTERING * RSM_FILTERING * 2.0;
    for (int i = 0; i < RSM_FILTERING * RSM_FILTERING; ++i) {
        ivec2 at = ivec2(i % RSM_FILTERING, i / RSM_FILTERING);
        RsmTexel texel = rsm_texel(block * RSM_FILTERING + at);
        float texel_flux = mean_flux(texel.flux);
        if (texel_flux > 0.0) {
            weight += pow(texel_flux, density_exponent);
            area += texel.area;
            flux += texel.flux;
            float distance_to_place = distance(vec2(at) + 0.5, place);
            if (distance_to_place < nearest_distance) {
                nearest_distance = distance_to_place;
                nearest = at;
                surface = texel;
            }
        }
    }
    if (!(weight > 0.0)) {
        return NO_VPL;
    }
#if RSM_FILTERING > 1
    place = clamp(place, vec2(nearest), vec2(nearest) + 1.0);
    surface.position_world = rsm_position_on_plane(surface, vec2(block * RSM_FILTERING) + place);
#endif
    // N · p, with p = weight / total_weight the chance of this block in one draw.
    float draws = float(vpl_count) * weight / total_weight;
    area /= draws;
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
        int columns = rsm_columns * (RSM_RESOLUTION / RSM_FILTERING);
        vec2 target = fract(point_table[index] + table_rotation);
        target.y *= total_weight;
        int row = row_above(target.y);
        int row_start = row * columns;
        target.x *= row_cdf[row_start + columns - 1];
        int column = column_above(row, columns, target.x);
        vec2 low = vec2(column > 0 ? row_cdf[row_start + column - 1] : 0.0, row > 0 ? marginal_cdf[row - 1] : 0.0);
        vec2 high = vec2(row_cdf[row_start + column], marginal_cdf[row]);
        // The maximum only guards the quotient: a block of no weight is never found.
        vec2 within = clamp((target - low) / max(high - low, vec2(1e-30)), 0.0, 1.0);
        vpl = block_vpl(ivec2(column, row), within);
    }
    virtual_point_lights[index] = vpl;
}
