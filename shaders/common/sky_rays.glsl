// Rays to the sky: each stands for some texels of its map.
//
// Provides: the structs, `sky_place`, `first_sky_ray`, `sky_seed`, `own_sky_ray`, `sky_origin`, `sees_sky`. Needs common/gbuffer.glsl,
// common/ray_hierarchy.glsl and common/hash.glsl.
// Constants: SKY_GUIDED, SKY_TEXEL [rad], SKY_LIFT, SKY_LEAST_LIFT and BLOCK (pixels along its side) of renderer/frame/passes/sky_light.py.

struct SkyRay {
    vec4 towards;  // unit, in the world, to the middle of its light; the first of its texels
    vec4 flux;     // [W/m²] on a surface square to the ray; number of its texels
};

struct SkyTexel {
    vec4 towards;  // unit, in the world; w unused
    vec4 flux;     // [W/m²] on a surface square to it; w unused
};

layout(std430, binding = SKY_RAYS_BINDING) readonly buffer SkyRays {
    SkyRay sky_rays[];  // 32 for each part of the sky, fewer for parts of few texels
};

layout(std430, binding = SKY_TEXELS_BINDING) readonly buffer SkyTexels {
    SkyTexel sky_texels[];  // ray by ray
};

// A place in what a ray stands for: `part` in [0, 1) chooses a texel, and `bits` a place in it. The flux is that of the
// whole ray, if all of it were as in this texel.
SkyTexel sky_place(int ray, float part, uint bits) {
    int first = int(sky_rays[ray].towards.w);
    int count = int(sky_rays[ray].flux.w);
    SkyTexel texel = sky_texels[first + min(int(part * float(count)), count - 1)];
    // A texel reaches along circles of latitude and of longitude. 1e-6 keeps the pole's own circle from being a point.
    vec2 across = normalize(texel.towards.xz + vec2(1e-6, 0.0));
    vec3 along = vec3(-across.y, 0.0, across.x);
    vec3 up = cross(along, texel.towards.xyz);
    vec2 offset = (vec2(bits & 0xffffu, bits >> 16) / 65536.0 - 0.5) * SKY_TEXEL;
    offset.x *= length(texel.towards.xz);
    return SkyTexel(
        vec4(normalize(texel.towards.xyz + offset.x * along + offset.y * up), 0.0), texel.flux * float(count));
}

// A pixel's first ray, below `stride`: its place in its block, in the order of a Bayer matrix. Neighbours are far apart in
// that order, so they take rays of other parts of the sky.
int first_sky_ray(ivec2 pixel, int stride) {
    int place = 0;
    for (int bit = 0; (BLOCK >> bit) > 1; ++bit) {
        int across = (pixel.x ^ pixel.y) >> bit & 1;
        place = place << 2 | across << 1 | (pixel.y >> bit & 1);
    }
    return place * stride / (BLOCK * BLOCK);
}

// Chance for ray number `ray` of a pixel.
uint sky_seed(ivec2 pixel, int ray) {
    return hashed(uint(ray) + hashed(uint(pixel.y * 65536 + pixel.x)));
}

// A pixel's own ray. With SKY_GUIDED it goes to any place that the ray stands for, so that no place is never looked at.
SkyTexel own_sky_ray(ivec2 pixel, int ray) {
#if SKY_GUIDED
    uint seed = sky_seed(pixel, ray);
    return sky_place(ray, unit_number(hashed(seed)), seed);
#else
    return SkyTexel(sky_rays[ray].towards, sky_rays[ray].flux);
#endif
}

// Where the rays of a receiver start. `longest` is the scene's diagonal.
vec3 sky_origin(Receiver receiver, float longest) {
    float away = distance(camera_to_world[3].xyz, receiver.position_world);
    return receiver.position_world + receiver.normal_world * (SKY_LIFT * away + SKY_LEAST_LIFT * longest);
}

// Whether a ray leaves the scene.
bool sees_sky(vec3 origin, vec3 towards, float longest, uint seed) {
#ifdef RAYS_MEET_HOLES
    ray_seed = seed;
#endif
    return ray_hit(origin, towards, longest).triangle == RAY_NO_TRIANGLE;
}
