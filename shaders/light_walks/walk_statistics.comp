// Light walks, part 2: the weight and the footprint of each sample, the samples that discs start at, and the scene length
// L where surfaces glow. One workgroup, and every sum in a fixed order, so that frames repeat bitwise.
//
// Reads and writes: samples, frame statistics. Writes: starts of the discs.
// Constants: WALK_GROUP_SIZE, WALK_STEPS, WALK_LAMPS, WALK_GLOWING, WALK_SPREAD. Python: renderer/frame/passes/light_walks.py.
//
// L is the RMS distance from their centroid of the places that light reaches first, weighted by flux: the RSM's texels,
// and the first reflections of light that surfaces emit.
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"
#include "common/mean_flux.glsl"
#include "common/hash.glsl"

layout(local_size_x = WALK_GROUP_SIZE) in;

layout(std430, binding = LATER_SAMPLES_BINDING) buffer LaterSamples {
    VirtualPointLight later_samples[];
};

layout(std430, binding = LATER_STARTS_BINDING) writeonly buffer LaterStarts {
    VirtualPointLight later_starts[];  // one for each disc
};

uniform int walk_count;
uniform int disc_count;
uniform vec3 moment_origin;  // a point near the scene, from where sums of squares lose few digits

const float PI = 3.14159265358979;

shared vec4 sums_position[WALK_GROUP_SIZE];  // Σ flux · offset; Σ flux
shared vec2 sums_rest[WALK_GROUP_SIZE];      // Σ flux · |offset|²; Σ flux of all first reflections

// The sample that a disc starts at: one of all reflections of the walks that are its own, drawn by the square root of its
// flux (Chao 1982). By flux alone there would be too few discs in dark rooms; evenly, too few where light is caught, as
// between a lamp and the ceiling above it. A walk that turns out otherwise, by rounding, moves no other disc's start.
VirtualPointLight start_of(int disc) {
    VirtualPointLight drawn = NO_VPL;
    float total = 0.0;
    for (int walk = disc % walk_count; walk < walk_count; walk += disc_count) {
        for (int i = 0; i < WALK_STEPS; ++i) {
            VirtualPointLight one = later_samples[walk * WALK_STEPS + i];
            float weight = sqrt(one.flux.w);
            total += weight;
            if (unit_number(hashed(uint(walk * WALK_STEPS + i))) * total < weight) {
                drawn = one;
            }
        }
    }
    return drawn;
}

void main() {
    int lane = int(gl_LocalInvocationIndex);
    vec4 flux_position = vec4(0.0);
    vec2 rest = vec2(0.0);
    for (int walk = lane; walk < walk_count; walk += WALK_GROUP_SIZE) {
        VirtualPointLight one = later_samples[walk * WALK_STEPS];
        float flux = mean_flux(one.flux.rgb);
        rest.y += flux;
#if WALK_GLOWING
        if (!(WALK_LAMPS != 0 && walk % 2 == 0) && flux > 0.0) {
            vec3 offset = one.position_footprint.xyz - moment_origin;
            flux_position += flux * vec4(offset, 1.0);
            rest.x += flux * dot(offset, offset);
        }
#endif
    }
    sums_position[lane] = flux_position;
    sums_rest[lane] = rest;
    barrier();
    for (int reach = WALK_GROUP_SIZE / 2; reach > 0; reach /= 2) {
        if (lane < reach) {
            sums_position[lane] += sums_position[lane + reach];
            sums_rest[lane] += sums_rest[lane + reach];
        }
        barrier();
    }
#if WALK_GLOWING
    if (lane == 0 && sums_position[0].w > 0.0) {
        vec3 middle = sums_position[0].xyz / sums_position[0].w;
        float square = sums_rest[0].x / sums_position[0].w;
        float variance = max(square - dot(middle, middle), 1e-12 * square);  // as in vpl_marginal_density.comp
        float lamps = total_flux;
        float share = sums_position[0].w / (sums_position[0].w + lamps);
        float lamp_variance = lamps > 0.0 ? scene_length * scene_length : 0.0;
        vec3 apart = lamps > 0.0 ? middle - light_middle : vec3(0.0);
        scene_length = sqrt(
            mix(lamp_variance, variance, share) + share * (1.0 - share) * dot(apart, apart));
    }
#endif
    memoryBarrierBuffer();
    barrier();
    // Samples of more flux count for more, as weights about 1 for a first reflection.
    float unit = max(sums_rest[0].y / float(walk_count), 1e-30);
    float footprint = WALK_SPREAD * scene_length * inversesqrt(float(walk_count));
    for (int i = lane; i < walk_count * WALK_STEPS; i += WALK_GROUP_SIZE) {
        float flux = mean_flux(later_samples[i].flux.rgb);
        later_samples[i].position_footprint.w = footprint;
        later_samples[i].normal_area.w = flux > 0.0 ? PI * footprint * footprint : 0.0;
        later_samples[i].flux.w = flux / unit;
    }
    memoryBarrierBuffer();
    barrier();
    for (int disc = lane; disc < disc_count; disc += WALK_GROUP_SIZE) {
        later_starts[disc] = start_of(disc);
    }
}
