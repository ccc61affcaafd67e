// Web page: the sampling weight of every RSM texel, and the moments of its flux.
//
// Reads: the RSM, importance. Writes: weights and moments. Runtime: virtual_point_lights/vpl_row_density.comp.
#include "common/rsm.glsl"
#include "web/vpl_sums.glsl"

uniform vec3 moment_origin;

layout(location = 0) out float out_weight;
layout(location = 1) out vec4 out_flux_position;  // flux · (position - moment_origin); flux
layout(location = 2) out float out_flux_square;   // flux · |position - moment_origin|²

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    RsmTexel surface = rsm_texel(texel);
    float flux = mean_flux(surface.flux);
    vec3 offset = surface.position_world - moment_origin;
    out_weight = flux > 0.0 ? sampling_weight(texel, flux) : 0.0;
    out_flux_position = flux * vec4(offset, 1.0);
    out_flux_square = flux * dot(offset, offset);
}
