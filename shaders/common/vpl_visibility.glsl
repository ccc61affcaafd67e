// Visibility of a VPL from its visibility map: a small hemispherical map of the surfaces that the VPL sees.
//
// Provides: reading and writing of a map's entries, and `vpl_visibility`. Needs common/virtual_point_lights.glsl.
// Constants: VISIBILITY_MAP_SIZE, VISIBILITY_MAP_REFINEMENT and VISIBILITY_LIFT [footprints] of
// renderer/frame/visibility_map_layout.py.
// Twin: tuner/surrogate/vpl_visibility.py. Imperfect shadow maps (Ritschel et al. 2008) hold the same, but as depths.
#include "common/hemi_octahedral.glsl"
#include "common/octahedral.glsl"

// visibility_maps [vpls, size, size] holds one entry for each ray: the distance to the surface that it hit [L], as the
// bits of a float, and that surface's normal on the VPL's side, in the VPL's frame, octahedral in 2 × 16 bits. If the
// sign bit of the first word is set, a silhouette runs through the texel. Then the second word is the index of a block
// in visibility_details [blocks, refinement, refinement], which holds entries of the same form for finer rays.
#ifndef VISIBILITY_MAP_ENTRY  // WebGL has no storage buffers: web/visibility_atlas.glsl defines its own
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

// The sign bit of a float: distances are never negative.
const uint VISIBILITY_BLOCK_BIT = 0x80000000u;
// A choice: a ray that hits nothing is stored as a wall that faces the VPL, this many diagonals of the scene away. Any
// number above 1 lies behind every receiver.
const float VISIBILITY_NOTHING = 2.0;
// A choice between 1, the longest hit in diagonals, and VISIBILITY_NOTHING: tells hits from misses.
const float VISIBILITY_FARTHEST = 1.5;

// The surface that a ray of the map hit, in the VPL's frame.
struct MetSurface {
    vec3 end;     // the hit, relative to the map's origin [L]
    vec3 normal;  // unit, on the VPL's side
};

struct VisibilityParameters {
    float bias;      // β: the overlap, as a share of the distance, up to which a surface does not shade
    float softness;  // σ: the overlap beyond it over which the light fades out, as a share of the distance
};

// The map's origin, lifted off the VPL's surface: rays start there, and distances are measured from there.
vec3 visibility_origin(VirtualPointLight vpl) {
    return vpl.position_footprint.xyz + vpl.normal_area.xyz * (VISIBILITY_LIFT * vpl.position_footprint.w);
}

// The unit direction of a texel's ray, in the VPL's frame.
vec3 visibility_axis(ivec2 texel, int size) {
    return hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(size)) - 1.0);
}

// The entry for a ray's hit.
uvec2 visibility_texel(float distance_in_l, vec3 normal_vpl) {
    return uvec2(floatBitsToUint(distance_in_l), packUnorm2x16(octahedral_encode(normal_vpl)));
}

// The entry that points to a block of finer rays.
uvec2 visibility_block(uint block) {
    return uvec2(VISIBILITY_BLOCK_BIT, block);
}

// The hit that an entry holds; `size` is the number of texels along the side of the entry's map.
MetSurface met_surface(uvec2 entry, ivec2 texel, int size) {
    return MetSurface(
        visibility_axis(texel, size) * uintBitsToFloat(entry.x), octahedral_decode(unpackUnorm2x16(entry.y)));
}

// The hit of the ray nearest to a direction of any length, in the VPL's frame. `map_start` is the map's first entry.
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

// The overlap of a surface and a receiver, as a share of the receiver's distance. It is the lesser of two heights: of
// the surface in front of the receiver's tangent plane, and of the receiver behind the surface's own plane. The first
// is receiver plane depth bias (Isidoro 2006). With the second, surfaces of one convex room or convex body never shade
// each other, however coarse the map, and walls may be as thin as they like. Positions are relative to the map's origin
// [L], in the VPL's frame.
float surface_overlap(MetSurface met, vec3 receiver, vec3 receiver_normal) {
    vec3 between = met.end - receiver;
    return min(dot(between, receiver_normal), dot(between, met.normal)) * inversesqrt(dot(receiver, receiver));
}

// Share of a VPL's light that reaches a receiver, in [0, 1], from one lookup. Texels are not interpolated: many VPLs
// average out, and a finer map is better than four lookups at the same cost.
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, int map_start, float scene_length,
    VisibilityParameters parameters
) {
    // Computed for each pair: cheaper than nine more numbers in shared memory.
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 to_receiver = (position_world - visibility_origin(vpl)) * frame / scene_length;
    vec3 normal = normal_world * frame;
    // A receiver below the VPL's horizon, or facing away from it, gets no light anyway.
    if (!(to_receiver.z > 0.0) || !(dot(to_receiver, normal) < 0.0)) {
        return 1.0;
    }
    float overlap = surface_overlap(seen_surface(to_receiver, map_start), to_receiver, normal);
    return 1.0 - clamp((overlap - parameters.bias) / parameters.softness, 0.0, 1.0);
}
