// Virtual point lights, part 1: for each row of the RSM atlas, the running sum of the sampling weights and the moments
// of the flux.
//
// Reads: the RSM, importance factors, artist parameters. Writes: `row_cdf`, `row_moments`. One workgroup for each row.
// Constants: ROW_GROUP_SIZE of renderer/frame/passes/virtual_point_lights.py; RSM_RESOLUTION, IMPORTANCE_CELLS.
// Python: renderer/frame/passes/virtual_point_lights.py.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"

layout(local_size_x = ROW_GROUP_SIZE) in;

layout(std430, binding = ROW_CDF_BINDING) buffer RowCdf {
    float row_cdf[];  // [rows, columns], inclusive, not normalised
};

struct RowMoments {
    vec4 flux_position;  // sum of flux · (position - moment_origin); sum of flux
    vec4 rest;           // sum of flux · |position - moment_origin|²; sum of weights; lit texels
};

layout(std430, binding = ROW_MOMENTS_BINDING) writeonly buffer RowMomentsBuffer {
    RowMoments row_moments[];
};

uniform vec3 moment_origin;  // a point near the light, from where sums of squares lose few digits

shared float scan[ROW_GROUP_SIZE];
shared vec4 sums_flux_position[ROW_GROUP_SIZE];
shared vec4 sums_rest[ROW_GROUP_SIZE];

void main() {
    int row = int(gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationID.x);
    int columns = rsm_columns * RSM_RESOLUTION;
    vec4 flux_position = vec4(0.0);
    vec4 rest = vec4(0.0);
    // Each invocation sums its own run of columns; then one scan over the runs' totals gives each run its start. This
    // needs few barriers, which are expensive where the invocations of a workgroup take turns.
    int run = (columns + ROW_GROUP_SIZE - 1) / ROW_GROUP_SIZE;
    int begin = min(lane * run, columns);
    int end = min(begin + run, columns);
    float total = 0.0;
    for (int column = begin; column < end; ++column) {
        RsmTexel texel = rsm_texel(ivec2(column, row));
        float flux = mean_flux(texel.flux);
        if (flux > 0.0) {
            float weight = sampling_weight(ivec2(column, row), flux);
            total += weight;
            vec3 offset = texel.position_world - moment_origin;
            flux_position += flux * vec4(offset, 1.0);
            rest += vec4(flux * dot(offset, offset), weight, 1.0, 0.0);
        }
        row_cdf[row * columns + column] = total;
    }
    // Inclusive scan (Hillis and Steele 1986) in a fixed order of additions, so that frames repeat bitwise.
    scan[lane] = total;
    barrier();
    for (int reach = 1; reach < ROW_GROUP_SIZE; reach *= 2) {
        float other = lane >= reach ? scan[lane - reach] : 0.0;
        barrier();
        scan[lane] += other;
        barrier();
    }
    float before = lane > 0 ? scan[lane - 1] : 0.0;
    for (int column = begin; column < end; ++column) {
        row_cdf[row * columns + column] += before;
    }
    sums_flux_position[lane] = flux_position;
    sums_rest[lane] = rest;
    barrier();
    for (int reach = ROW_GROUP_SIZE / 2; reach > 0; reach /= 2) {
        if (lane < reach) {
            sums_flux_position[lane] += sums_flux_position[lane + reach];
            sums_rest[lane] += sums_rest[lane + reach];
        }
        barrier();
    }
    if (lane == 0) {
        row_moments[row] = RowMoments(sums_flux_position[0], sums_rest[0]);
    }
}
