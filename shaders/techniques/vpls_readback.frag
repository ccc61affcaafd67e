// Irradiance of one VPL at every pixel, blended additively over all draws.
//
// Reads: G-buffer, scene length; the VPL comes in uniforms. Writes: irradiance [W/m²].
// Python: renderer/techniques/vpls_readback.py, a technique to compare with.
#include "common/gbuffer.glsl"
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"

const float PI = 3.14159265358979;
#include "common/vpl_irradiance.glsl"

uniform vec4 position_footprint;
uniform vec4 normal_area;
uniform vec3 flux;
uniform float intensity;
uniform float falloff_footprint;
uniform float extinction_coefficient;

out vec4 out_irradiance;

void main() {
    Receiver receiver = gbuffer_receiver(ivec2(gl_FragCoord.xy));
    VirtualPointLight vpl = VirtualPointLight(position_footprint, normal_area, vec4(flux, 0.0));
    FalloffParameters parameters = FalloffParameters(intensity, falloff_footprint, extinction_coefficient);
    vec3 irradiance = vpl_irradiance(receiver.position_world, receiver.normal_world, vpl, scene_length, parameters);
    out_irradiance = receiver.valid ? vec4(irradiance, 1.0) : vec4(0.0);
}
