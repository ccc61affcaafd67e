// Sky light: irradiance from the sky along rays, for the interleaved filter, or in place of what the filter made.
//
// Reads: G-buffer, ray hierarchy, sky rays, open irradiance; with LISTED_PIXELS, the pixel list and the irradiance that
// this is added to. Writes: irradiance [W/m²], alpha 1 where a surface is.
// Constants: SKY_LIFT, OPEN_NODES, BLOCK (pixels along its side), LISTED_PIXELS (only pixels of the list). Python: renderer/frame/passes/sky_light.py.
//
// The rays are shared out among the pixels of a block. A window of the filter holds each ray once, so that what it shows
// has shadows from all of them. What a pixel gets is a ratio: the share of its own rays' light that arrives, of all that
// would arrive in the open. So open places have no noise, nor do borders of the image.
#include "common/gbuffer.glsl"
#include "common/ray_hierarchy.glsl"
#if LISTED_PIXELS
#include "common/pixel_list.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;

struct SkyRay {
    vec4 towards;  // unit, in the world; w unused
    vec4 flux;     // [W/m²] on a surface square to the ray; w unused
};

layout(std430, binding = SKY_RAYS_BINDING) readonly buffer SkyRays {
    SkyRay sky_rays[];  // 32 for each part of the sky, fewer for parts of few texels
};

layout(std430, binding = SKY_OPEN_BINDING) readonly buffer SkyOpen {
    vec4 sky_open[];  // [OPEN_NODES, OPEN_NODES] irradiance [W/m²] in the open, at nodes of the octahedral map of normals
};

uniform float longest;  // the scene's diagonal [world units]
uniform int ray_count;
uniform int stride;  // from one of a pixel's rays to its next: a power of two, at most BLOCK²
#if LISTED_PIXELS
uniform sampler2D base;  // added to the result
#endif

// Irradiance in the open on a surface with this normal.
vec3 open_irradiance(vec3 normal) {
    vec2 place = octahedral_encode(normal) * float(OPEN_NODES - 1);
    ivec2 node = clamp(ivec2(place), ivec2(0), ivec2(OPEN_NODES - 2));
    vec2 blend = place - vec2(node);
    int at = node.y * OPEN_NODES + node.x;
    return mix(
        mix(sky_open[at].rgb, sky_open[at + 1].rgb, blend.x),
        mix(sky_open[at + OPEN_NODES].rgb, sky_open[at + OPEN_NODES + 1].rgb, blend.x), blend.y);
}

// A pixel's first ray, below `stride`: its place in its block, in the order of a Bayer matrix. Neighbours are far apart in
// that order, so they take rays of other parts of the sky.
int first_ray(ivec2 pixel) {
    int place = 0;
    for (int bit = 0; (BLOCK >> bit) > 1; ++bit) {
        int across = (pixel.x ^ pixel.y) >> bit & 1;
        place = place << 2 | across << 1 | (pixel.y >> bit & 1);
    }
    return place * stride / (BLOCK * BLOCK);
}

void main() {
#if LISTED_PIXELS
    ivec2 pixel = listed_pixel(gl_WorkGroupID.xy, gl_LocalInvocationIndex);
#else
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
#endif
    if (pixel.x < 0 || any(greaterThanEqual(pixel, imageSize(out_irradiance)))) {
        return;
    }
    Receiver receiver = gbuffer_receiver(pixel);
    vec3 irradiance = vec3(0.0);
    if (receiver.valid) {
        float away = max(longest, distance(camera_to_world[3].xyz, receiver.position_world));
        vec3 origin = receiver.position_world + receiver.normal_world * (SKY_LIFT * away);
        vec3 arriving = vec3(0.0);
        vec3 sent = vec3(0.0);
        for (int i = first_ray(pixel); i < ray_count; i += stride) {
            vec3 towards = sky_rays[i].towards.xyz;
            float cosine = dot(receiver.normal_world, towards);
            if (cosine <= 0.0) {
                continue;
            }
#ifdef RAYS_MEET_HOLES
            ray_seed = uint(i) ^ uint(pixel.y * 65536 + pixel.x);
#endif
            vec3 light = sky_rays[i].flux.rgb * cosine;
            sent += light;
            if (ray_hit(origin, towards, longest).triangle == RAY_NO_TRIANGLE) {
                arriving += light;
            }
        }
        irradiance = open_irradiance(receiver.normal_world) * arriving / max(sent, vec3(1e-30));
    }
#if LISTED_PIXELS
    irradiance += texelFetch(base, pixel, 0).rgb;
#endif
    imageStore(out_irradiance, pixel, vec4(irradiance, receiver.valid ? 1.0 : 0.0));
}
