// Web page: sums the moments of the flux over blocks of 8×8 texels. Repeated until one texel is left.
//
// Reads and writes: `flux_position`, `flux_square` of web/vpl_weights.frag.
// Runtime: virtual_point_lights/vpl_marginal_density.comp.
uniform sampler2D flux_position;
uniform sampler2D flux_square;

layout(location = 0) out vec4 out_flux_position;
layout(location = 1) out float out_flux_square;

void main() {
    ivec2 low = ivec2(gl_FragCoord.xy) * 8;
    ivec2 high = min(low + 8, textureSize(flux_position, 0));
    out_flux_position = vec4(0.0);
    out_flux_square = 0.0;
    for (int y = low.y; y < high.y; ++y) {
        for (int x = low.x; x < high.x; ++x) {
            out_flux_position += texelFetch(flux_position, ivec2(x, y), 0);
            out_flux_square += texelFetch(flux_square, ivec2(x, y), 0).r;
        }
    }
}
