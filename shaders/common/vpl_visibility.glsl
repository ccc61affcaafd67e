// Visibility of a VPL from its visibility map: a small hemispherical map of the surfaces that the VPL sees.
//
// Provides: reading and writing of a map's entries, and `vpl_visibility`. Needs common/virtual_point_lights.glsl.
// Constants: VISIBILITY_MAP_SIZE, VISIBILITY_MAP_REFINEMENT, VISIBILITY_LIFT [footprints], VISIBILITY_ROUNDING [share of
// the distance] and those of the corner mark, of renderer/frame/visibility_map_layout.py.
// Twin: tuner/surrogate/vpl_visibility.py. Imperfect shadow maps (Ritschel et al. 2008) hold the same, but as depths.
#include "common/hemi_octahedral.glsl"
#include "common/octahedral.glsl"

// visibility_maps [vpls, size, size] holds one entry for each ray: the distance to the surface that it hit [L], as the
// bits of a float, and that surface's normal on the VPL's side, in the VPL's frame, octahedral in 2 × 16 bits. If the
// sign bit of the first word is set, a silhouette runs through the texel. Then the second word is the index of a block
// in visibility_details [blocks, refinement, refinement], which holds entries of the same form for finer rays. The
// lowest bits of the first word are the texel's corner mark, 0 for none. A concave corner of two surfaces may run through
// a marked texel, so a receiver must not lie behind the surface of a neighbouring texel either. The neighbours are three,
// across a side, another side and the vertex between them. With VISIBILITY_NEAREST_VERTEX, they are those nearest to the
// receiver's direction; else those across the vertex number mark − VISIBILITY_FIRST_VERTEX, which lies beyond the texel
// in x if bit 0 is set, in y if bit 1 is set.
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

// The entry for a ray's hit, without a corner mark.
uvec2 visibility_texel(float distance_in_l, vec3 normal_vpl) {
    return uvec2(
        floatBitsToUint(distance_in_l) & ~VISIBILITY_CORNER_MASK, packUnorm2x16(octahedral_encode(normal_vpl)));
}

// The entry that points to a block of finer rays. Any corner in it is looked for.
uvec2 visibility_block(uint block) {
    return uvec2(VISIBILITY_BLOCK_BIT | VISIBILITY_NEAREST_VERTEX, block);
}

// The hit that an entry holds; `size` is the number of texels along the side of the entry's map.
MetSurface met_surface(uvec2 entry, ivec2 texel, int size) {
    return MetSurface(
        visibility_axis(texel, size) * uintBitsToFloat(entry.x), octahedral_decode(unpackUnorm2x16(entry.y)));
}

// The finest texels along the side of a map: places on it are counted in them.
const int VISIBILITY_FINEST = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_REFINEMENT;

// What a map holds at a place.
struct MapTexel {
    MetSurface met;
    int side;     // of the texel, in finest texels
    uint corner;  // its mark
};

// The texel at a place. `map_start` is the map's first entry.
MapTexel map_texel(ivec2 place, int map_start) {
    const int refinement = VISIBILITY_MAP_REFINEMENT;
    ivec2 texel = place / refinement;
    uvec2 entry = VISIBILITY_MAP_ENTRY(map_start + texel.y * VISIBILITY_MAP_SIZE + texel.x);
    uint corner = entry.x & VISIBILITY_CORNER_MASK;
#if VISIBILITY_MAP_REFINEMENT > 1
    if ((entry.x & VISIBILITY_BLOCK_BIT) != 0u) {
        entry = VISIBILITY_DETAIL_ENTRY(entry.y, (place % refinement));
        return MapTexel(met_surface(entry, place, VISIBILITY_MAP_SIZE * refinement), 1, corner);
    }
#endif
    return MapTexel(met_surface(entry, texel, VISIBILITY_MAP_SIZE), refinement, corner);
}

// Whether a receiver is on the other side of the sheet that a ray hit, near the hit. Such a sheet hides it, however thin it
// is: the overlaps below are 0 then, up to rounding and to the sheet's bend.
bool shows_its_back(MetSurface met, vec3 receiver, vec3 receiver_normal) {
    vec3 between = met.end - receiver;
    float apart = length(between);
    float rounding = VISIBILITY_ROUNDING * (length(receiver) + length(met.end));
    return dot(met.normal, receiver_normal) < VISIBILITY_SHEET_COSINE
        && dot(between, met.normal) > -VISIBILITY_SHEET_BEND * apart - rounding
        && dot(between, receiver_normal) > -VISIBILITY_SHEET_TILT * apart - rounding;
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

// The same for a receiver whose tangent plane hides the middle of a disc. The disc's part in sight begins where that
// plane cuts the disc's, and it is beyond the surface if that place is behind the surface too.
float rim_overlap(MetSurface met, vec3 receiver, vec3 receiver_normal) {
    float squared = max(dot(receiver_normal.xy, receiver_normal.xy), 1e-12);
    vec3 cut = vec3(receiver_normal.xy * (dot(receiver, receiver_normal) / squared), 0.0);
    return min(dot(met.end - receiver, met.normal), dot(met.end - cut, met.normal))
        * inversesqrt(dot(receiver, receiver));
}

// Whether a hit lies behind the plane of another one, by more than rounding.
bool is_behind(MetSurface met, MetSurface other) {
    return dot(met.end - other.end, other.normal) < -VISIBILITY_ROUNDING * (length(met.end) + length(other.end));
}

// The overlap of a receiver with a surface that reaches as far as the receiver's direction, because a corner does: the
// height of the receiver behind the surface's plane, unless the hit is behind the receiver's tangent plane. In that
// plane it may be the corner itself.
float corner_overlap(MetSurface met, vec3 receiver, vec3 receiver_normal) {
    if (shows_its_back(met, receiver, receiver_normal)) {
        return 1.0;
    }
    if (!(dot(receiver, receiver_normal) < 0.0)) {
        return rim_overlap(met, receiver, receiver_normal);
    }
    vec3 between = met.end - receiver;
    float share = inversesqrt(dot(receiver, receiver));
    return dot(between, receiver_normal) * share > -VISIBILITY_ROUNDING ? dot(between, met.normal) * share : -1.0;
}

// The overlap of a receiver with the planes of its own texel's hit and of three around it. A plane counts if none of the
// four hits is behind it, so that it reaches across all of them, and if its hit is not behind the own plane: between two
// rays on either side of a concave corner, the nearer of the two planes is in sight.
float joined_overlap(MapTexel own, vec2 place, int map_start, vec3 receiver, vec3 receiver_normal) {
    ivec2 inside = ivec2(place), start = inside / own.side * own.side;
    bvec2 beyond = greaterThanEqual(2.0 * place, vec2(2 * start + own.side));
    if (own.corner >= VISIBILITY_FIRST_VERTEX) {
        uint vertex = own.corner - VISIBILITY_FIRST_VERTEX;
        beyond = bvec2((vertex & 1u) != 0u, (vertex & 2u) != 0u);
    }
    ivec2 beside = ivec2(beyond.x ? start.x + own.side : start.x - 1, beyond.y ? start.y + own.side : start.y - 1);
    MetSurface met[4];
    met[0] = own.met;
    for (int i = 1; i < 4; ++i) {
        ivec2 around = ivec2((i & 1) != 0 ? beside.x : inside.x, (i & 2) != 0 ? beside.y : inside.y);
        bool on_map = all(greaterThanEqual(around, ivec2(0))) && all(lessThan(around, ivec2(VISIBILITY_FINEST)));
        // WebGL knows no conditional expression of structures.
        met[i] = own.met;
        if (on_map) {
            met[i] = map_texel(around, map_start).met;
        }
    }
    float overlap = -1.0;
    for (int i = 0; i < 4; ++i) {
        bool counts = !is_behind(met[i], own.met);
        for (int j = 0; j < 4; ++j) {
            counts = counts && !is_behind(met[j], met[i]);
        }
        if (counts) {
            overlap = max(overlap, corner_overlap(met[i], receiver, receiver_normal));
        }
    }
    return overlap;
}

// Share of a VPL's light that reaches a receiver, in [0, 1], from one lookup, or four at a concave corner. Texels are not
// interpolated: many VPLs average out, and a finer map is better than four lookups at the same cost.
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, int map_start, float scene_length,
    VisibilityParameters parameters
) {
    // Computed for each pair: cheaper than nine more numbers in shared memory.
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 to_receiver = (position_world - visibility_origin(vpl)) * frame / scene_length;
    vec3 normal = normal_world * frame;
    // A receiver below the VPL's horizon gets no light anyway.
    if (!(to_receiver.z > 0.0)) {
        return 1.0;
    }
    vec2 place = (hemi_octahedral_encode(to_receiver) * 0.5 + 0.5) * float(VISIBILITY_FINEST);
    place = min(place, vec2(float(VISIBILITY_FINEST) - 0.5));
    MapTexel own = map_texel(ivec2(place), map_start);
    bool facing = dot(to_receiver, normal) < 0.0;
    float overlap = facing ? surface_overlap(own.met, to_receiver, normal) : rim_overlap(own.met, to_receiver, normal);
    overlap = shows_its_back(own.met, to_receiver, normal) ? 1.0 : overlap;
    if (own.corner != 0u && overlap < parameters.bias + parameters.softness) {
        overlap = max(overlap, joined_overlap(own, place, map_start, to_receiver, normal));
    }
    return 1.0 - clamp((overlap - parameters.bias) / parameters.softness, 0.0, 1.0);
}
