// Sky light, part 3: irradiance from the sky along rays, for the interleaved filter, or in place of what the filter made.
//
// Reads: G-buffer, ray hierarchy, sky rays, open irradiance; with SKY_GUIDED, bits of the pixels' rays and candidates of the
// tiles; with LISTED_PIXELS, the pixel list and the irradiance that this is added to. Writes: irradiance [W/m²], alpha 1
// where a surface is.
// Constants: SKY_LIFT, SKY_LEAST_LIFT, SKY_TEXEL, SKY_WORDS, SKY_GUIDED (tiles have looked at the sky), OPEN_NODES, BLOCK (pixels along its
// side, and along that of a tile), LISTED_PIXELS (only pixels of the list). Python: renderer/frame/passes/sky_light.py.
//
// The rays are shared out among the pixels of a block. A window of the filter holds each ray once, so that what it shows
// has shadows from all of them. To what arrives along its own rays, a pixel adds the same share of all other light that
// would arrive in the open. So open places have no noise, nor do borders of the image.
//
// Indoors few rays pass, and the share is rough. Where a tile's surroundings are mostly blocked, a pixel casts as many rays
// again, all to the candidates of its tile, and takes its first rays for what of the sky is no candidate.
// First, since common/ray_alpha.glsl includes it only where there are holes.
#include "common/hash.glsl"
#include "common/gbuffer.glsl"
#include "common/ray_hierarchy.glsl"
#include "common/sky_rays.glsl"
#include "common/mean_flux.glsl"
#if LISTED_PIXELS
#include "common/pixel_list.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;

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

#if SKY_GUIDED
layout(std430, binding = SKY_BITS_BINDING) readonly buffer SkyBits {
    uint sky_bits[];  // [pixels]: which of a pixel's first rays are open
};

uint open_bits(ivec2 pixel) {
    return sky_bits[pixel.y * imageSize(out_irradiance).x + pixel.x];
}
#endif

// Irradiance as what arrives along the pixel's rays, and as the share of them that arrives of what they leave out of the
// open sky. The share is one for all channels: where a pixel has no ray to a red patch of the sky, others speak for it.
vec3 shared_irradiance(ivec2 pixel, Receiver receiver, vec3 origin) {
#if SKY_GUIDED && !LISTED_PIXELS
    uint bits = open_bits(pixel);  // of the same rays
#endif
    vec3 arriving = vec3(0.0);
    vec3 sent = vec3(0.0);
    int taken = 0;
    for (int i = first_sky_ray(pixel, stride); i < ray_count; i += stride) {
        SkyTexel sky = own_sky_ray(pixel, i);
        vec3 light = sky.flux.rgb * max(dot(receiver.normal_world, sky.towards.xyz), 0.0);
        sent += light;
#if SKY_GUIDED && !LISTED_PIXELS
        bool is_open = (bits & 1u) != 0u;
        bits >>= 1;
#else
        bool is_open = light.r + light.g + light.b > 0.0
                    && sees_sky(origin, sky.towards.xyz, longest, sky_seed(pixel, i));
#endif
        arriving += is_open ? light : vec3(0.0);
        ++taken;
    }
    float weight = float(ray_count) / float(max(taken, 1));
    // A pixel whose rays all lie below its horizon counts as open: in a blocked place that is rare.
    float share = mean_flux(sent) > 0.0 ? mean_flux(arriving) / mean_flux(sent) : 1.0;
    return weight * arriving + share * (open_irradiance(receiver.normal_world) - weight * sent);
}

#if SKY_GUIDED
layout(std430, binding = SKY_CANDIDATES_BINDING) readonly buffer SkyCandidates {
    // [tiles, 1 + SKY_WORDS]: number of candidates, and 1 where most rays are open; then bits of 32 rays each, and the
    // number of candidates before them.
    uvec2 sky_candidates[];
};

uniform int probe_stride;  // `stride` of the rays whose bits they are

// The candidate number `n` of the tile whose entries begin at `start`.
int candidate(int start, uint n) {
    int low = 0;
    int high = SKY_WORDS;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (sky_candidates[start + 1 + middle].y <= n) {
            low = middle;
        } else {
            high = middle;
        }
    }
    uvec2 word = sky_candidates[start + 1 + low];
    for (uint i = word.y; i < n; ++i) {
        word.x &= word.x - 1u;
    }
    return 32 * low + findLSB(word.x);
}

// Irradiance from candidates along new rays, and from the rest of the sky along the pixel's first rays.
vec3 guided_irradiance(ivec2 pixel, Receiver receiver, vec3 origin, int start, uint candidates) {
    vec3 arriving = vec3(0.0);
    int taken = 0;
    for (int i = first_sky_ray(pixel, stride); i < ray_count && candidates > 0u; i += stride) {
        uint seed = sky_seed(pixel, i);
        float n = (float(i) + unit_number(hashed(seed))) / float(ray_count) * float(candidates);
        SkyTexel sky = sky_place(candidate(start, min(uint(n), candidates - 1u)), fract(n), seed);
        vec3 light = sky.flux.rgb * max(dot(receiver.normal_world, sky.towards.xyz), 0.0);
        if (light.r + light.g + light.b > 0.0 && sees_sky(origin, sky.towards.xyz, longest, seed)) {
            arriving += light;
        }
        ++taken;
    }
    vec3 irradiance = arriving * (float(candidates) / float(max(taken, 1)));
    uint bits = open_bits(pixel);
    int first = first_sky_ray(pixel, probe_stride);
    int probes = (ray_count - first + probe_stride - 1) / probe_stride;
    while (bits != 0u) {
        int ray = first + findLSB(bits) * probe_stride;
        bits &= bits - 1u;
        if ((sky_candidates[start + 1 + ray / 32].x >> (ray % 32) & 1u) == 0u) {
            SkyTexel sky = own_sky_ray(pixel, ray);
            float cosine = max(dot(receiver.normal_world, sky.towards.xyz), 0.0);
            irradiance += sky.flux.rgb * (cosine * float(ray_count) / float(probes));
        }
    }
    return irradiance;
}
#endif

void main() {
#if LISTED_PIXELS
    ivec2 pixel = listed_pixel(gl_WorkGroupID.xy, gl_LocalInvocationIndex);
#else
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
#endif
    ivec2 size = imageSize(out_irradiance);
    if (pixel.x < 0 || any(greaterThanEqual(pixel, size))) {
        return;
    }
    Receiver receiver = gbuffer_receiver(pixel);
    vec3 irradiance = vec3(0.0);
    if (receiver.valid) {
        vec3 origin = sky_origin(receiver, longest);
#if SKY_GUIDED
        ivec2 tile = pixel / BLOCK;
        int start = (tile.y * ((size.x + BLOCK - 1) / BLOCK) + tile.x) * (1 + SKY_WORDS);
        uvec2 candidates = sky_candidates[start];
        irradiance = candidates.y != 0u
            ? shared_irradiance(pixel, receiver, origin)
            : guided_irradiance(pixel, receiver, origin, start, candidates.x);
#else
        irradiance = shared_irradiance(pixel, receiver, origin);
#endif
    }
#if LISTED_PIXELS
    irradiance = max(irradiance, vec3(0.0)) + texelFetch(base, pixel, 0).rgb;
#endif
    imageStore(out_irradiance, pixel, vec4(irradiance, receiver.valid ? 1.0 : 0.0));
}
