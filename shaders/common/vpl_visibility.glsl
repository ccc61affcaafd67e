// What a VPL sees, from its small map of surfaces. Twin: tuner/vpl_visibility.py.
#include "common/hemi_octahedral.glsl"
#include "common/octahedral.glsl"

// [vpls, size, size]: what a ray along the texel's axis meets, as its distance [L] in bits of a float, and its
// normal towards the VPL in the VPL's frame, octahedral in 2 × 16 bits.
#ifndef VISIBILITY_MAP_ENTRY  // WebGL has no storage buffers, and brings its own
layout(std430, binding = VISIBILITY_MAPS_BINDING) buffer VisibilityMaps {
    uvec2 visibility_maps[];
};
#define VISIBILITY_MAP_ENTRY(index) visibility_maps[index]
#endif

struct VisibilityParameters {
    float bias;      // of the distance: how far two surfaces may overlap before one shades the other
    float softness;  // of the distance, over which light then fades out
};

// Rays start, and distances count, from a point lifted off the VPL's surface: by this many footprints, and by
// this share of L at least. What an RSM holds lies off its surface by as much as interpolated depth rounds, some
// 1e-4 of L, and a VPL behind its own surface would see nothing else.
const float VISIBILITY_LIFT = 0.01;
const float VISIBILITY_LEAST_LIFT = 1e-3;

vec3 visibility_origin(VirtualPointLight vpl, float scene_length) {
    float lift = max(VISIBILITY_LIFT * vpl.position_footprint.w, VISIBILITY_LEAST_LIFT * scene_length);
    return vpl.position_footprint.xyz + vpl.normal_area.xyz * lift;
}

vec3 visibility_axis(ivec2 texel) {
    return hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(VISIBILITY_MAP_SIZE)) - 1.0);
}

uvec2 visibility_texel(float distance_in_l, vec3 normal_vpl) {
    return uvec2(floatBitsToUint(distance_in_l), packUnorm2x16(octahedral_encode(normal_vpl)));
}

// Share of a VPL's light that reaches a receiver: what the ray nearest to its direction met blocks if it stands
// before the receiver's tangent plane and the receiver behind its own. The first is receiver plane depth bias
// (Isidoro 2006); with the second, surfaces of one convex room or one convex body never shade each other, however
// coarse the map, and a wall may be as thin as it likes. No blend of neighbouring texels: many VPLs blend by
// themselves, and for the price of four lookups finer maps are better.
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, int map_start, float scene_length,
    VisibilityParameters parameters
) {
    // Made anew for each pair: cheaper than nine more numbers from shared memory.
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 to_receiver = (position_world - visibility_origin(vpl, scene_length)) * frame / scene_length;
    vec3 normal = normal_world * frame;
    // The receiver's plane from the VPL, in units of L; a receiver below the horizon gets nothing anyway.
    float plane = dot(to_receiver, normal);
    if (!(to_receiver.z > 0.0) || !(plane < 0.0)) {
        return 1.0;
    }
    vec2 place = (hemi_octahedral_encode(to_receiver) * 0.5 + 0.5) * float(VISIBILITY_MAP_SIZE);
    ivec2 texel = min(ivec2(place), ivec2(VISIBILITY_MAP_SIZE - 1));
    uvec2 met = VISIBILITY_MAP_ENTRY(map_start + texel.y * VISIBILITY_MAP_SIZE + texel.x);
    vec3 end = visibility_axis(texel) * uintBitsToFloat(met.x);
    vec3 met_normal = octahedral_decode(unpackUnorm2x16(met.y));
    float before = dot(end, normal) - plane;
    float behind = dot(end - to_receiver, met_normal);
    float overlap = min(before, behind) * inversesqrt(dot(to_receiver, to_receiver));
    return 1.0 - clamp((overlap - parameters.bias) / parameters.softness, 0.0, 1.0);
}
