// Sky light, part 1: which of their rays to the sky are open at the pixels of a tile. One workgroup for each tile.
//
// Reads: G-buffer, ray hierarchy, sky rays. Writes: bits of each pixel's rays; bits and numbers of each tile's.
// Constants: SKY_LIFT, SKY_LEAST_LIFT, SKY_WORDS, BLOCK. Python: renderer/frame/passes/sky_light.py.
// First, since common/ray_alpha.glsl includes it only where there are holes.
#include "common/hash.glsl"
#include "common/gbuffer.glsl"
#include "common/ray_hierarchy.glsl"
#include "common/sky_rays.glsl"

layout(local_size_x = BLOCK, local_size_y = BLOCK) in;

layout(std430, binding = SKY_PROBES_BINDING) writeonly buffer SkyProbes {
    uint sky_probes[];  // [tiles, 1 + SKY_WORDS]: numbers of open and blocked rays, 16 bits each; bits of the open ones
};

layout(std430, binding = SKY_BITS_BINDING) writeonly buffer SkyBits {
    uint sky_bits[];  // [pixels]: which of a pixel's own rays are open
};

uniform float longest;  // the scene's diagonal [world units]
uniform int ray_count;
uniform int stride;  // as in sky_light.comp

shared uint open_rays[SKY_WORDS];
shared uint open_count;
shared uint blocked_count;

void main() {
    int lane = int(gl_LocalInvocationIndex);
    for (int i = lane; i < SKY_WORDS; i += BLOCK * BLOCK) {
        open_rays[i] = 0u;
    }
    open_count = 0u;
    blocked_count = 0u;
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(gbuffer_depth, 0);
    Receiver receiver = gbuffer_receiver(min(pixel, size - 1));
    uint bits = 0u;
    if (receiver.valid && all(lessThan(pixel, size))) {
        vec3 origin = sky_origin(receiver, longest);
        uint blocked = 0u;
        int k = 0;
        for (int i = first_sky_ray(pixel, stride); i < ray_count; i += stride) {
            vec3 towards = own_sky_ray(pixel, i).towards.xyz;
            if (dot(receiver.normal_world, towards) > 0.0) {
                if (sees_sky(origin, towards, longest, sky_seed(pixel, i))) {
                    bits |= 1u << k;
                    atomicOr(open_rays[i / 32], 1u << (i % 32));
                } else {
                    ++blocked;
                }
            }
            ++k;
        }
        atomicAdd(open_count, uint(bitCount(bits)));
        atomicAdd(blocked_count, blocked);
    }
    if (all(lessThan(pixel, size))) {
        sky_bits[pixel.y * size.x + pixel.x] = bits;
    }
    barrier();
    int start = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * (1 + SKY_WORDS);
    for (int i = lane; i < SKY_WORDS; i += BLOCK * BLOCK) {
        sky_probes[start + 1 + i] = open_rays[i];
    }
    if (lane == 0) {
        sky_probes[start] = open_count | blocked_count << 16;
    }
}
