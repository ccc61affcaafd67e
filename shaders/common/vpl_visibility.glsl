// What a VPL sees, from its small map of surfaces. Twin: tuner/surrogate/vpl_visibility.py.
#include "common/hemi_octahedral.glsl"
#include "common/octahedral.glsl"

// visibility_maps [vpls, size, size]: what a ray along the texel's axis meets, as its distance [L] in bits of a
// float, and its normal towards the VPL in the VPL's frame, octahedral in 2 × 16 bits. With the sign bit set, a
// silhouette runs through the texel, and the second word is the place of its block in
// visibility_details [blocks, refinement, refinement], which are such texels of a map so much finer.
#ifndef VISIBILITY_MAP_ENTRY  // WebGL has no storage buffers, and brings its own
layout(std430, binding = VISIBILITY_MAPS_BINDING) buffer VisibilityMaps {
    uvec2 visibility_maps[];
};
layout(std430, binding = VISIBILITY_DETAILS_BINDING) buffer VisibilityDetails {
    uvec2 visibility_details[];
};
#define VISIBILITY_MAP_ENTRY(index) visibility_maps[index]
#define VISIBILITY_DETAIL_ENTRY(block, inside) \
    visibility_details[(int(block) * VISIBILITY_MAP_REFINEMENT + inside.y) * VISIBILITY_MAP_REFINEMENT + inside.x]
#endif

const uint VISIBILITY_BLOCK_BIT = 0x80000000u; // in an entry of a map: the rest is the index of a refined block
// What meets nothing ends so many diagonals of the scene away, at a wall that faces the VPL: no receiver is behind it.
const float VISIBILITY_NOTHING = 2.0;
// What meets something ends nearer than so many.
const float VISIBILITY_FARTHEST = 1.5;

// What a VPL sees, in its frame.
struct MetSurface {
    vec3 end;  // from the map's origin [L]
    vec3 normal;
};

struct VisibilityParameters {
    float bias;      // of the distance: how far two surfaces may overlap before one shades the other
    float softness;  // of the distance, over which light then fades out
};

// Where rays start, and distances count from.
vec3 visibility_origin(VirtualPointLight vpl, float scene_length) {
    float lift = max(VISIBILITY_LIFT * vpl.position_footprint.w, VISIBILITY_LEAST_LIFT * scene_length);
    return vpl.position_footprint.xyz + vpl.normal_area.xyz * lift;
}

vec3 visibility_axis(ivec2 texel, int size) {
    return hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(size)) - 1.0);
}

uvec2 visibility_texel(float distance_in_l, vec3 normal_vpl) {
    return uvec2(floatBitsToUint(distance_in_l), packUnorm2x16(octahedral_encode(normal_vpl)));
}

uvec2 visibility_block(uint block) {
    return uvec2(VISIBILITY_BLOCK_BIT, block);
}

MetSurface met_surface(uvec2 entry, ivec2 texel, int size) {
    return MetSurface(
        visibility_axis(texel, size) * uintBitsToFloat(entry.x), octahedral_decode(unpackUnorm2x16(entry.y)));
}

// What the ray nearest to a direction (in the VPL's frame, not unit) met.
MetSurface seen_surface(vec3 direction, int map_start) {
    vec2 place = (hemi_octahedral_encode(direction) * 0.5 + 0.5) * float(VISIBILITY_MAP_SIZE);
    ivec2 texel = min(ivec2(place), ivec2(VISIBILITY_MAP_SIZE - 1));
    uvec2 entry = VISIBILITY_MAP_ENTRY(map_start + texel.y * VISIBILITY_MAP_SIZE + texel.x);
    int size = VISIBILITY_MAP_SIZE;
#if VISIBILITY_MAP_REFINEMENT > 1
    if ((entry.x & VISIBILITY_BLOCK_BIT) != 0u) {
        const int refinement = VISIBILITY_MAP_REFINEMENT;
        ivec2 inside = min(ivec2((place - vec2(texel)) * float(refinement)), ivec2(refinement - 1));
        entry = VISIBILITY_DETAIL_ENTRY(entry.y, inside);
        texel = texel * refinement + inside;
        size *= refinement;
    }
#endif
    return met_surface(entry, texel, size);
}

// By how much, of its distance, a surface overlaps a receiver: it stands so far before the receiver's tangent
// plane, and the receiver so far behind its own; the lesser of the two. The first is receiver plane depth bias
// (Isidoro 2006); with the second, surfaces of one convex room or one convex body never shade each other, however
// coarse the map, and a wall may be as thin as it likes. Positions from the map's origin [L], in the VPL's frame.
float surface_overlap(MetSurface met, vec3 receiver, vec3 receiver_normal) {
    vec3 between = met.end - receiver;
    return min(dot(between, receiver_normal), dot(between, met.normal)) * inversesqrt(dot(receiver, receiver));
}

// Share of a VPL's light that reaches a receiver, past the surface that the ray nearest to its direction met. No
// blend of neighbouring texels: many VPLs blend by themselves, and for the price of four lookups finer maps are
// better.
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, int map_start, float scene_length,
    VisibilityParameters parameters
) {
    // Made anew for each pair: cheaper than nine more numbers from shared memory.
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 to_receiver = (position_world - visibility_origin(vpl, scene_length)) * frame / scene_length;
    vec3 normal = normal_world * frame;
    // A receiver that is below the horizon, or faces away, gets nothing anyway.
    if (!(to_receiver.z > 0.0) || !(dot(to_receiver, normal) < 0.0)) {
        return 1.0;
    }
    float overlap = surface_overlap(seen_surface(to_receiver, map_start), to_receiver, normal);
    return 1.0 - clamp((overlap - parameters.bias) / parameters.softness, 0.0, 1.0);
}
