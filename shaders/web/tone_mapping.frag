// Web page, tone mapping: exposure, tone curve and sRGB encoding.
//
// Reads: radiance; exposure in a uniform. Writes: display values. Runtime: display/tone_mapping.comp.
#include "common/tone_curve.glsl"

uniform sampler2D radiance;
uniform float exposure;

layout(location = 0) out vec4 out_display;

void main() {
    vec3 color = tone_curve(texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb * exposure);
    out_display = vec4(srgb_encode(clamp(color, 0.0, 1.0)), 1.0);
}
