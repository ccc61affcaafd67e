// One VPL for every block of stride × stride pixels: the middle pixel stands for the whole block and reflects its
// direct light.
//
// Reads: G-buffer, direct irradiance. Writes: VPLs.
// Python: renderer/techniques/screen_space_only.py, a technique to compare with.
// Source: Ritschel, Grosch and Seidel 2009, for indirect light from what the camera sees.
#include "common/gbuffer.glsl"
#include "common/pixel_area.glsl"
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) writeonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform sampler2D gbuffer_albedo;
uniform sampler2D direct_irradiance;
uniform int stride;
uniform ivec2 blocks;

const float PI = 3.14159265358979;

void main() {
    ivec2 block = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(block, blocks))) {
        return;
    }
    ivec2 size = textureSize(gbuffer_depth, 0);
    ivec2 pixel = min(block * stride + stride / 2, size - 1);
    Receiver surface = gbuffer_receiver(pixel);
    VirtualPointLight vpl = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));
    if (surface.valid) {
        float area = pixel_area(surface, size) * float(stride * stride);
        vec3 radiosity = texelFetch(gbuffer_albedo, pixel, 0).rgb * texelFetch(direct_irradiance, pixel, 0).rgb;
        vpl = VirtualPointLight(
            vec4(surface.position_world, sqrt(area / PI)), vec4(surface.normal_world, area), vec4(radiosity * area, 0.0));
    }
    virtual_point_lights[block.y * blocks.x + block.x] = vpl;
}
