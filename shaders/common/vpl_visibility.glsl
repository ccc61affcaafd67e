// What a VPL sees, from its small map of distances. Twin: tuner/vpl_visibility.py.
#include "common/hemi_octahedral.glsl"

layout(std430, binding = VISIBILITY_MAPS_BINDING) buffer VisibilityMaps {
    float visibility_maps[];  // [vpls, size, size]: distance to the nearest surface along the texel's axis [L]
};

struct VisibilityParameters {
    float bias;      // of the distance, by which a blocker must stand before the receiver's plane
    float softness;  // of the distance, over which light fades in
};

// Rays start, and distances count, from a point lifted off the VPL's surface by this many footprints.
const float VISIBILITY_LIFT = 0.01;

vec3 visibility_origin(VirtualPointLight vpl) {
    return vpl.position_footprint.xyz + vpl.normal_area.xyz * (VISIBILITY_LIFT * vpl.position_footprint.w);
}

// A texel's axis may meet the receiver's plane far before the receiver or far behind it: before this share of
// the distance it says nothing of the receiver, and beyond the other it is asked no farther.
const float VISIBILITY_NEAREST = 0.5;
const float VISIBILITY_FARTHEST = 1.5;

// Share of a VPL's light that reaches a receiver: the four texels around its direction, compared each along
// its own axis with the receiver's tangent plane, so that a coarse map does not shade the plane it shows
// (receiver plane depth bias, Isidoro 2006); an axis that misses the plane, with the receiver's distance.
float vpl_visibility(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, mat3 frame, int map_start,
    float scene_length, VisibilityParameters parameters
) {
    vec3 to_receiver = position_world - visibility_origin(vpl);
    vec3 normal_vpl = normal_world * frame;
    vec3 direction = to_receiver * frame;
    // The receiver's plane from the VPL, in units of L; a receiver below the horizon gets nothing anyway.
    float plane = dot(to_receiver, normal_world) / scene_length;
    if (!(direction.z > 0.0) || !(plane < 0.0)) {
        return 1.0;
    }
    vec2 place = (hemi_octahedral_encode(direction) * 0.5 + 0.5) * float(VISIBILITY_MAP_SIZE) - 0.5;
    vec2 corner = floor(place);
    vec2 blend = place - corner;
    float distance_to_receiver = length(to_receiver) / scene_length;
    float visible = 0.0;
    float weights = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 step = vec2(i & 1, i >> 1);
        ivec2 texel = clamp(ivec2(corner + step), ivec2(0), ivec2(VISIBILITY_MAP_SIZE - 1));
        vec3 axis = hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(VISIBILITY_MAP_SIZE)) - 1.0);
        float slope = dot(axis, normal_vpl);
        // 1e-4: an axis that grazes the plane within float32's rounding is taken to miss it.
        float reach = slope < -1e-4 ? plane / (slope * distance_to_receiver) : 1.0;
        if (reach > VISIBILITY_NEAREST) {
            vec2 share = mix(1.0 - blend, blend, step);
            float nearest = visibility_maps[map_start + texel.y * VISIBILITY_MAP_SIZE + texel.x];
            float asked = distance_to_receiver * min(reach, VISIBILITY_FARTHEST);
            float lead = nearest / asked - 1.0 + parameters.bias;
            visible += share.x * share.y * clamp(lead / parameters.softness + 0.5, 0.0, 1.0);
            weights += share.x * share.y;
        }
    }
    return weights > 1e-4 ? visible / weights : 1.0;
}
