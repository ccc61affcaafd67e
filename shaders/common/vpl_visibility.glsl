// What a VPL sees, from its small map of surfaces. Twin: tuner/vpl_visibility.py.
#include "common/hemi_octahedral.glsl"
#include "common/octahedral.glsl"

// [vpls, size, size]: what a ray along the texel's axis meets, as its distance [L] in bits of a float, and its
// normal towards the VPL in the VPL's frame, octahedral in 2 × 16 bits.
layout(std430, binding = VISIBILITY_MAPS_BINDING) buffer VisibilityMaps {
    uvec2 visibility_maps[];
};

struct VisibilityParameters {
    float bias;      // of the distance: by how much a blocker must overlap both planes to block all
    float softness;  // of a texel, over which light fades in across a shadow's edge
};

// Rays start, and distances count, from a point lifted off the VPL's surface by this many footprints.
const float VISIBILITY_LIFT = 0.01;

vec3 visibility_origin(VirtualPointLight vpl) {
    return vpl.position_footprint.xyz + vpl.normal_area.xyz * (VISIBILITY_LIFT * vpl.position_footprint.w);
}

vec3 visibility_axis(ivec2 texel) {
    return hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(VISIBILITY_MAP_SIZE)) - 1.0);
}

uvec2 visibility_texel(float distance_in_l, vec3 normal_vpl) {
    return uvec2(floatBitsToUint(distance_in_l), packUnorm2x16(octahedral_encode(normal_vpl)));
}

// A ray that ended unblocked says little of what lies behind its end: before this share of the receiver's
// distance nothing, from there to the whole distance ever more.
const float VISIBILITY_NEAREST = 0.8;

// Share of a VPL's light that reaches a receiver: the four texels around its direction. What a texel's ray met
// blocks if it stands before the receiver's tangent plane and the receiver behind its own. The first is receiver
// plane depth bias (Isidoro 2006); with the second, surfaces of one convex room or one convex body never shade
// each other, however coarse the map, and a wall may be as thin as it likes. The blend of the four is cut at one
// half, which finds an edge between the texels that it passes (Green 2007, alpha-tested magnification).
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, mat3 frame, int map_start,
    float scene_length, VisibilityParameters parameters
) {
    vec3 to_receiver = (position_world - visibility_origin(vpl)) * frame / scene_length;
    vec3 normal = normal_world * frame;
    // The receiver's plane from the VPL, in units of L; a receiver below the horizon gets nothing anyway.
    float plane = dot(to_receiver, normal);
    if (!(to_receiver.z > 0.0) || !(plane < 0.0)) {
        return 1.0;
    }
    vec2 place = (hemi_octahedral_encode(to_receiver) * 0.5 + 0.5) * float(VISIBILITY_MAP_SIZE) - 0.5;
    vec2 corner = floor(place);
    vec2 blend = place - corner;
    float inverse_squared = 1.0 / dot(to_receiver, to_receiver);
    float sharpness = sqrt(inverse_squared) / parameters.bias;
    float visible = 0.0;
    float weights = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 step = vec2(i & 1, i >> 1);
        ivec2 texel = clamp(ivec2(corner + step), ivec2(0), ivec2(VISIBILITY_MAP_SIZE - 1));
        uvec2 met = visibility_maps[map_start + texel.y * VISIBILITY_MAP_SIZE + texel.x];
        vec3 end = visibility_axis(texel) * uintBitsToFloat(met.x);
        vec3 met_normal = octahedral_decode(unpackUnorm2x16(met.y));
        float before = dot(end, normal) - plane;
        float behind = dot(end - to_receiver, met_normal);
        float blocked = clamp(min(before, behind) * sharpness, 0.0, 1.0);
        float reach = dot(end, to_receiver) * inverse_squared;
        float known = clamp((reach - VISIBILITY_NEAREST) / (1.0 - VISIBILITY_NEAREST), 0.0, 1.0);
        vec2 share = mix(1.0 - blend, blend, step);
        float weight = share.x * share.y * max(blocked, known);
        visible += weight * (1.0 - blocked);
        weights += weight;
    }
    // 1e-4: where no ray came near the receiver, nothing is known to block.
    float seen = weights > 1e-4 ? visible / weights : 1.0;
    return clamp((seen - 0.5) / parameters.softness + 0.5, 0.0, 1.0);
}
