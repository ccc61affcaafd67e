// Irradiance of one dynamic light at every pixel, blended additively over all draws.
//
// Reads: G-buffer, dynamic lights. Writes: light accumulation, in units of `accumulation_unit` [W/m²].
// Python: renderer/techniques/light_per_draw.py, a technique to compare with.
#include "common/dynamic_lights.glsl"
#include "common/gbuffer.glsl"

uniform int light_index;
uniform float accumulation_unit;

layout(location = 0) out vec4 out_accumulation;

void main() {
    Receiver receiver = gbuffer_receiver(ivec2(gl_FragCoord.xy));
    vec3 irradiance =
        dynamic_light_irradiance(dynamic_lights[light_index], receiver.position_world, receiver.normal_world);
    out_accumulation = vec4(receiver.valid ? irradiance / accumulation_unit : vec3(0.0), 0.0);
}
