// Virtual point lights, part 2: the running sum over the atlas rows, and the frame statistics.
//
// Reads: the rows' moments of part 1. Writes: `marginal_cdf`, the frame statistics. One invocation: a few thousand
// additions in a fixed order, so that frames repeat bitwise.
// The scene length L is the flux-weighted RMS distance of the lit texels from their centroid.
// Python: renderer/frame/passes/virtual_point_lights.py. The web page's version of L: web/scene_length.glsl.
#include "common/scene_length.glsl"

layout(local_size_x = 1) in;

// As in vpl_row_density.comp.
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
    // Without light no VPL has flux, and any length will do.
    scene_length = 1.0;
    light_middle = vec3(0.0);
    if (total_flux > 0.0) {
        vec3 mean_position = flux_position.xyz / total_flux;
        light_middle = mean_position;
        float variance = rest.x / total_flux - dot(mean_position, mean_position);
        // A single lit point has no extent. The choice of at least 1e-6 of its distance keeps d / L finite.
        scene_length = sqrt(max(variance, 1e-12 * rest.x / total_flux));
    }
}
