// Direct light: irradiance at every pixel from the punctual lights, with shadows from their RSMs, and from the light
// pre-pass.
//
// Reads: G-buffer, lights, RSM depth, light accumulation. Writes: direct irradiance [W/m²], alpha 1 where a surface is.
// Constants: RSM_RESOLUTION. Python: renderer/frame/passes/direct_light.py.
#include "common/gbuffer.glsl"
#include "common/rsm.glsl"
#include "common/shadow.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;

uniform int light_count;
uniform sampler2D light_accumulation;
uniform float accumulation_unit;  // irradiance [W/m²] of a stored 1; 0 where there is nothing to add

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_irradiance)))) {
        return;
    }
    Receiver receiver = gbuffer_receiver(pixel);
    vec3 irradiance = vec3(0.0);
    if (receiver.valid && accumulation_unit > 0.0) {
        // 65504 is the largest half float: a larger sum was stored as infinity.
        irradiance = accumulation_unit * min(texelFetch(light_accumulation, pixel, 0).rgb, 65504.0);
    }
    if (receiver.valid) {
        for (int i = 0; i < light_count; ++i) {
            vec3 to_light = towards_light(lights[i], receiver.position_world);
            float cosine = dot(receiver.normal_world, to_light);
            vec3 arriving = irradiance_facing(lights[i], receiver.position_world);
            if (cosine > 0.0 && any(greaterThan(arriving, vec3(0.0)))) {
                irradiance += arriving * (cosine * shadow(lights[i], receiver, to_light));
            }
        }
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, receiver.valid ? 1.0 : 0.0));
}
