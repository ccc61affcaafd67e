// VPL density, part 1: for each row of the RSM atlas, the running sum of the sampling weights and the
// moments of the flux. One workgroup per row.
#include "common/rsm.glsl"

layout(local_size_x = ROW_GROUP_SIZE) in;

layout(std430, binding = ROW_CDF_BINDING) writeonly buffer RowCdf {
    float row_cdf[];  // [rows, columns], inclusive, not normalised
};

struct RowMoments {
    vec4 flux_position;  // sum of flux · (position - moment_origin); sum of flux
    vec4 rest;           // sum of flux · |position - moment_origin|²; sum of weights; lit texels
};

layout(std430, binding = ROW_MOMENTS_BINDING) writeonly buffer RowMomentsBuffer {
    RowMoments row_moments[];
};

uniform float density_exponent;
uniform vec3 moment_origin;

shared float scan[ROW_GROUP_SIZE];
shared vec4 sums_flux_position[ROW_GROUP_SIZE];
shared vec4 sums_rest[ROW_GROUP_SIZE];

void main() {
    int row = int(gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationID.x);
    int columns = rsm_columns * RSM_RESOLUTION;
    vec4 flux_position = vec4(0.0);
    vec4 rest = vec4(0.0);
    float carry = 0.0;
    for (int start = 0; start < columns; start += ROW_GROUP_SIZE) {
        int column = start + lane;
        float weight = 0.0;
        if (column < columns) {
            RsmTexel texel = rsm_texel(ivec2(column, row));
            float flux = mean_flux(texel.flux);
            if (flux > 0.0) {
                weight = pow(flux, density_exponent);
                vec3 offset = texel.position_world - moment_origin;
                flux_position += flux * vec4(offset, 1.0);
                rest += vec4(flux * dot(offset, offset), weight, 1.0, 0.0);
            }
        }
        // Inclusive scan of Hillis and Steele (1986): the order of additions is fixed, so frames repeat bitwise.
        scan[lane] = weight;
        barrier();
        for (int reach = 1; reach < ROW_GROUP_SIZE; reach *= 2) {
            float other = lane >= reach ? scan[lane - reach] : 0.0;
            barrier();
            scan[lane] += other;
            barrier();
        }
        if (column < columns) {
            row_cdf[row * columns + column] = carry + scan[lane];
        }
        carry += scan[ROW_GROUP_SIZE - 1];
        barrier();
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
        // The scan's last entry, not the tree's sum: binary search must meet the very same total.
        sums_rest[0].y = carry;
        row_moments[row] = RowMoments(sums_flux_position[0], sums_rest[0]);
    }
}
