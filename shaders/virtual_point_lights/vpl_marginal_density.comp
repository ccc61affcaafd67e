// VPL density, part 2: the running sum over rows, and the frame's statistics. One invocation: a few
// thousand additions in a fixed order.
#include "common/scene_length.glsl"

layout(local_size_x = 1) in;

struct RowMoments {
    vec4 flux_position;
    vec4 rest;
};

layout(std430, binding = ROW_MOMENTS_BINDING) readonly buffer RowMomentsBuffer {
    RowMoments row_moments[];
};

layout(std430, binding = MARGINAL_CDF_BINDING) writeonly buffer MarginalCdf {
    float marginal_cdf[];  // [rows], inclusive, not normalised
};

uniform int rows;

void main() {
    vec4 flux_position = vec4(0.0);
    vec4 rest = vec4(0.0);
    for (int row = 0; row < rows; ++row) {
        flux_position += row_moments[row].flux_position;
        rest += row_moments[row].rest;
        marginal_cdf[row] = rest.y;
    }
    total_weight = rest.y;
    total_flux = flux_position.w;
    lit_texels = rest.z;
    // Nothing lit: no VPL carries flux, and any length serves.
    scene_length = 1.0;
    if (total_flux > 0.0) {
        vec3 mean_position = flux_position.xyz / total_flux;
        float variance = rest.x / total_flux - dot(mean_position, mean_position);
        // A single lit point has no extent; 1e-6 of its distance keeps the ratio d / L finite.
        scene_length = sqrt(max(variance, 1e-12 * rest.x / total_flux));
    }
}
