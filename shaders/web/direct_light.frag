// Web page, direct light: irradiance of all lights, with shadows from their RSMs.
//
// Reads: G-buffer, lights, RSM depth. Writes: direct irradiance [W/m²]. Runtime: direct_light/direct_light.comp, which
// adds the light pre-pass.
// Constants: LIGHT_COUNT of renderer/export/web_page/web_page.py.
#include "common/gbuffer.glsl"
#include "common/rsm.glsl"
#include "common/shadow.glsl"

layout(location = 0) out vec4 out_irradiance;

void main() {
    Receiver receiver = gbuffer_receiver(ivec2(gl_FragCoord.xy));
    vec3 irradiance = vec3(0.0);
    if (receiver.valid) {
        for (int i = 0; i < LIGHT_COUNT; ++i) {
            vec3 to_light = towards_light(lights[i], receiver.position_world);
            float cosine = dot(receiver.normal_world, to_light);
            vec3 arriving = irradiance_facing(lights[i], receiver.position_world);
            if (cosine > 0.0 && any(greaterThan(arriving, vec3(0.0)))) {
                irradiance += arriving * (cosine * shadow(lights[i], receiver, to_light));
            }
        }
    }
    out_irradiance = vec4(irradiance, receiver.valid ? 1.0 : 0.0);
}
