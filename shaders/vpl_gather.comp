// VPL gather: indirect irradiance at every pixel from all VPLs, which pass through shared memory.
#include "common/gbuffer.glsl"
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"

const float PI = 3.14159265358979;
#include "common/vpl_irradiance.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

layout(rgba32f, binding = 0) writeonly uniform image2D out_irradiance;

uniform int vpl_count;
uniform float intensity;
uniform float falloff_footprint;
uniform float falloff_transmittance;

shared VirtualPointLight batch[64];

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(out_irradiance);
    FalloffParameters parameters = FalloffParameters(intensity, falloff_footprint, falloff_transmittance);
    Receiver receiver = gbuffer_receiver(min(pixel, size - 1));
    vec3 irradiance = vec3(0.0);
    for (int start = 0; start < vpl_count; start += 64) {
        int lane = int(gl_LocalInvocationIndex);
        if (start + lane < vpl_count) {
            batch[lane] = virtual_point_lights[start + lane];
        }
        barrier();
        int count = min(64, vpl_count - start);
        for (int i = 0; i < count; ++i) {
            irradiance += vpl_irradiance(
                receiver.position_world, receiver.normal_world, batch[i], scene_length, parameters);
        }
        barrier();
    }
    if (all(lessThan(pixel, size))) {
        imageStore(out_irradiance, pixel, receiver.valid ? vec4(irradiance, 1.0) : vec4(0.0));
    }
}
