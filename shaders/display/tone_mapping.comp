// Tone mapping: exposure, tone curve and sRGB encoding, from radiance to the 8-bit display image.
//
// Reads: radiance, exposure. Writes: the display image. Python: renderer/frame/passes/tone_mapping.py.
// Twins: tuner/metrics/tone_curve.py, tuner/report/templates/scene.js.
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D radiance;

layout(std430, binding = EXPOSURE_BINDING) readonly buffer Exposure {
    float exposure;
};

layout(rgba8, binding = DISPLAY_IMAGE) writeonly uniform image2D out_display;

#include "common/tone_curve.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_display)))) {
        return;
    }
    vec3 color = tone_curve(texelFetch(radiance, pixel, 0).rgb * exposure);
    imageStore(out_display, pixel, vec4(srgb_encode(clamp(color, 0.0, 1.0)), 1.0));
}
