// Light walks: light goes on from where lamps and glowing surfaces sent it, along random rays, and is reflected wherever
// it meets a surface. Each reflection leaves a sample, a VPL whose flux is what the surface reflects.
//
// Reads: starts (samples drawn from the RSM, and from glowing surfaces), directions, ray hierarchy.
// Writes: samples, [walks, steps], dark ones where a walk has left the scene. One invocation for each walk.
// Constants: WALK_LAMPS and WALK_GLOWING (1 if there are such starts), GLOWING_SAMPLES, WALK_STEPS, WALK_ENDS (1 if the
// last step stands for all that would follow), WALK_SURVIVAL, WALK_MOST_RAYS.
// Python: renderer/frame/passes/light_walks.py.
//
// A walk leaves a surface with the density cosθ/π, so each ray carries the same part of the flux (Keller 1997). All of it
// is kept, and the albedo of the surface met multiplies it: no walk ends by chance before its last step, and the flux has
// no noise of its own.
// The samples of step s are the light of s + 1 reflections, or of s + 2 if the walk began in an RSM, where the light had
// been reflected once.

// First, since common/ray_alpha.glsl includes it only where there are holes.
#include "common/hash.glsl"
#include "common/virtual_point_lights.glsl"
#include "common/ray_hierarchy.glsl"
#include "common/hemi_octahedral.glsl"
#include "common/mean_flux.glsl"

layout(local_size_x = 64) in;

#if WALK_LAMPS
layout(std430, binding = LAMP_STARTS_BINDING) readonly buffer LampStarts {
    VirtualPointLight lamp_starts[];
};
#endif
#if WALK_GLOWING
layout(std430, binding = GLOWING_SAMPLES_BINDING) readonly buffer GlowingSamples {
    VirtualPointLight glowing_samples[];
};
#endif
layout(std430, binding = WALK_DIRECTIONS_BINDING) readonly buffer WalkDirections {
    vec2 walk_directions[];  // for the first ray of each walk
};
layout(std430, binding = LATER_SAMPLES_BINDING) writeonly buffer LaterSamples {
    VirtualPointLight later_samples[];
};

uniform int walk_count;
uniform float longest;         // the scene's diagonal [world units]
uniform int lamp_steps;        // reflections that a walk from an RSM records
uniform int glowing_steps;     // and one from a glowing surface
uniform vec2 table_rotation;   // as in virtual_point_lights.comp

const float PI = 3.14159265358979;
const float GOLDEN_RATIO = 0.61803398874989;  // of all numbers, its multiples spread most evenly in [0, 1)
// A choice: a ray starts so far above its surface, in diagonals of the scene. 7 digits of float32 leave 60 times less.
const float WALK_LIFT = 1e-5;

// A direction about a normal with the density cosθ/π (Malley's method: a point of the disc, lifted to the hemisphere).
vec3 cosine_direction(vec3 normal, vec2 point) {
    float radius = sqrt(point.x);
    float angle = 2.0 * PI * point.y;
    return hemisphere_frame(normal) * vec3(radius * cos(angle), radius * sin(angle), sqrt(max(1.0 - point.x, 0.0)));
}

// Where the walk begins, and how many reflections it records. The flux is that of the walk alone.
VirtualPointLight walk_start(int walk, out int steps) {
#if WALK_LAMPS && WALK_GLOWING
    bool glowing = walk % 2 == 1;
    int index = walk / 2;
#elif WALK_GLOWING
    const bool glowing = true;
    int index = walk;
#else
    const bool glowing = false;
    int index = walk;
#endif
    const int shares = WALK_LAMPS + WALK_GLOWING;
    VirtualPointLight start = NO_VPL;
    steps = lamp_steps;
#if WALK_LAMPS
    if (!glowing) {
        start = lamp_starts[index];
    }
#endif
#if WALK_GLOWING
    if (glowing) {
        steps = glowing_steps;
        start = glowing_samples[index % GLOWING_SAMPLES];
        start.flux.rgb *= float(GLOWING_SAMPLES * shares) / float(walk_count);
    }
#endif
    return start;
}

// Two numbers in [0, 1) for a walk's ray after its first.
vec2 walk_numbers(uint seed, int ray) {
    return vec2(unit_number(hashed(seed ^ uint(2 * ray))), unit_number(hashed(seed ^ uint(2 * ray + 1))));
}

// Where a walk meets a surface next, and what that reflects; NO_VPL where it leaves the scene.
VirtualPointLight next_reflection(VirtualPointLight place, vec2 numbers, uint seed) {
    vec3 normal = place.normal_area.xyz;
    vec3 origin = place.position_footprint.xyz + normal * (WALK_LIFT * longest);
    vec3 direction = cosine_direction(normal, numbers);
#ifdef RAYS_MEET_HOLES
    ray_seed = seed;
#endif
    RayHit hit = ray_hit(origin, direction, longest);
    if (hit.triangle == RAY_NO_TRIANGLE) {
        return NO_VPL;
    }
    return VirtualPointLight(
        vec4(origin + direction * hit.distance, 1.0), vec4(ray_hit_normal(hit, direction), 1.0),
        vec4(place.flux.rgb * ray_hit_albedo(hit), 0.0));
}

#if WALK_ENDS
// One of all reflections from `first` on, drawn by its flux (Chao 1982), with the flux of all of them. From there on a
// walk ends by Russian roulette, as its light may be caught in a corner that absorbs little. One number decides where it
// ends: it goes on while the product of its chances is above `least`. These numbers are evenly spread over the walks, so
// that nearly the right share of them goes on from each step.
VirtualPointLight one_of_the_rest(VirtualPointLight first, int ray, float least, uint seed) {
    VirtualPointLight place = first;
    VirtualPointLight drawn = first;
    float total = mean_flux(first.flux.rgb);
    float chance = 1.0;
    for (int i = 0; i < WALK_MOST_RAYS; ++i) {
        float draw = walk_numbers(seed, 2 * (ray + i) + 1).x;
        VirtualPointLight next = next_reflection(place, walk_numbers(seed, 2 * (ray + i)), seed + uint(ray + i));
        float most = max(max(next.flux.r, next.flux.g), next.flux.b);
        float before = max(max(place.flux.r, place.flux.g), place.flux.b);
        if (!(most > 0.0)) {
            break;
        }
        float flux = mean_flux(next.flux.rgb);
        total += flux;
        if (draw * total < flux) {
            drawn = next;
        }
        float survival = min(most / before, WALK_SURVIVAL);
        chance *= survival;
        if (chance <= least) {
            break;
        }
        place = next;
        place.flux.rgb /= survival;
    }
    drawn.flux.rgb *= total / max(mean_flux(drawn.flux.rgb), 1e-30);
    return drawn;
}
#endif

void main() {
    int walk = int(gl_GlobalInvocationID.x);
    if (walk >= walk_count) {
        return;
    }
    int steps;
    VirtualPointLight place = walk_start(walk, steps);
    uint seed = hashed(uint(walk));
    for (int i = 0; i < WALK_STEPS; ++i) {
        VirtualPointLight reflected = NO_VPL;
        if (i < steps && any(greaterThan(place.flux.rgb, vec3(0.0)))) {
            vec2 numbers = i == 0 ? fract(walk_directions[walk] + table_rotation) : walk_numbers(seed, 2 * i);
            reflected = next_reflection(place, numbers, seed + uint(i));
        }
        place = reflected;
#if WALK_ENDS
        if (i == steps - 1 && mean_flux(reflected.flux.rgb) > 0.0) {
            reflected = one_of_the_rest(reflected, steps, fract(float(walk) * GOLDEN_RATIO), seed);
        }
#endif
        later_samples[walk * WALK_STEPS + i] = reflected;
    }
}
