// Places VPLs: inverts the running sums of the sampling weights at the points of a table (inverse transform sampling).
//
// Provides: `placed_vpl`. Needs common/rsm.glsl and common/virtual_point_lights.glsl. The including file defines
// `sum_in_row(row, column)` and `sum_of_rows(row)`, the sums up to and including a column or row, and
// `sampling_weight(texel, flux)`, `total_weight`, `vpl_count` and `rows`.
// Constants: RSM_RESOLUTION, RSM_FILTERING (renderer/frame/runtime_options.py).

// The first row whose running sum exceeds `target`.
int row_above(float target) {
    int low = 0;
    int high = rows - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (sum_of_rows(middle) > target) { high = middle; } else { low = middle + 1; }
    }
    return low;
}

// The first column, up to `last`, of a row whose running sum exceeds `target`.
int column_above(int row, int last, float target) {
    int low = 0;
    int high = last;
    while (low < high) {
        int middle = (low + high) / 2;
        if (sum_in_row(row, middle) > target) { high = middle; } else { low = middle + 1; }
    }
    return low;
}

// Choices: a texel beside another shows the same surface if its normal is within 26° and its position is within a tenth
// of the distance from the plane. Where that is not so, a VPL that does not slide flickers and is no more wrong.
const float SAME_SURFACE_COSINE = 0.9;
const float SAME_SURFACE_SLOPE = 0.1;

// Whether a surface goes on into the texel `beside` its own, in the tile from `low` to `high`.
bool goes_on(RsmTexel surface, ivec2 beside, ivec2 low, ivec2 high) {
    if (any(lessThan(beside, low)) || any(greaterThan(beside, high))) {
        return false;
    }
    RsmTexel other = rsm_texel(beside);
    vec3 between = other.position_world - surface.position_world;
    return mean_flux(other.flux) > 0.0
        && dot(other.normal_world, surface.normal_world) > SAME_SURFACE_COSINE
        && abs(dot(between, surface.normal_world)) < SAME_SURFACE_SLOPE * length(between);
}

// A VPL at a texel, with the mean flux and area of the RSM_FILTERING² texels around it, within its face. It then has
// the colour of its surroundings and not of one texel, which would flicker as the light moves. The mean is
// sum(flux) / sum(weight), which conserves energy; for texels of equal probability it is the plain mean.
// `within` is the position inside the texel, in [0, 1]².
VirtualPointLight texel_vpl(ivec2 texel, vec2 within) {
    RsmTexel surface = rsm_texel(texel);
    if (!(mean_flux(surface.flux) > 0.0)) {
        return NO_VPL;  // rounding in the sums may select a dark texel beside a lit one
    }
    const int reach = RSM_FILTERING / 2;
    ivec2 tile_low = texel / RSM_RESOLUTION * RSM_RESOLUTION;
    ivec2 low = max(texel - reach, tile_low);
    ivec2 tile_high = tile_low + RSM_RESOLUTION - 1;
    ivec2 high = min(texel + reach, tile_high);
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
    // N · p, the expected number of VPLs in these texels: p = weight / total_weight is their probability in one draw.
    float draws = float(vpl_count) * weight / total_weight;
    area /= draws;
#if RSM_FILTERING > 1
    // The rest of the table's point after the inversion gives the position inside the texel. As the light moves or the
    // density changes, the VPL slides over the surface and does not jump between texel centres. It does not slide over
    // the surface's edge: beyond a wall's foot it would light what is behind the wall.
    ivec2 towards = ivec2(within.x < 0.5 ? -1 : 1, within.y < 0.5 ? -1 : 1);
    within.x = goes_on(surface, texel + ivec2(towards.x, 0), tile_low, tile_high) ? within.x : 0.5;
    within.y = goes_on(surface, texel + ivec2(0, towards.y), tile_low, tile_high) ? within.y : 0.5;
    surface.position_world = rsm_position_on_plane(surface, vec2(texel) + within);
#endif
    return VirtualPointLight(
        vec4(surface.position_world, sqrt(area / PI)), vec4(surface.normal_world, area), vec4(flux / draws, 0.0));
}

// The VPL for a point of the table in [0, 1)²: inverts the marginal over rows, then the conditional along the row.
VirtualPointLight placed_vpl(vec2 point) {
    if (!(total_weight > 0.0)) {
        return NO_VPL;
    }
    int last = rsm_columns * RSM_RESOLUTION - 1;
    vec2 target = point;
    target.y *= total_weight;
    int row = row_above(target.y);
    target.x *= sum_in_row(row, last);
    int column = column_above(row, last, target.x);
    vec2 low = vec2(column > 0 ? sum_in_row(row, column - 1) : 0.0, row > 0 ? sum_of_rows(row - 1) : 0.0);
    vec2 high = vec2(sum_in_row(row, column), sum_of_rows(row));
    // 1e-30 guards the quotient where rounding selects a texel without weight.
    vec2 within = clamp((target - low) / max(high - low, vec2(1e-30)), 0.0, 1.0);
    return texel_vpl(ivec2(column, row), within);
}
