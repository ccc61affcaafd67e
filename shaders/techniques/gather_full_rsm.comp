// One VPL for every block of stride × stride RSM texels: the block's middle texel stands for the whole block.
//
// Reads: the RSM. Writes: VPLs. Python: renderer/techniques/gather_full_rsm.py, a technique to compare with.
#include "common/rsm.glsl"
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) writeonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int stride;
uniform ivec2 blocks;

void main() {
    ivec2 block = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(block, blocks))) {
        return;
    }
    RsmTexel texel = rsm_texel(min(block * stride + stride / 2, textureSize(rsm_depth, 0) - 1));
    float texels = float(stride * stride);
    float area = texel.area * texels;
    virtual_point_lights[block.y * blocks.x + block.x] = VirtualPointLight(
        vec4(texel.position_world, sqrt(area / PI)), vec4(texel.normal_world, area), vec4(texel.flux * texels, 0.0));
}
