// One ray of a VPL's visibility map: the surface that the VPL sees in one direction of its hemisphere.
//
// Provides: `cast_visibility_texel`, `visibility_nothing`. Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"
#include "common/ray_hierarchy.glsl"
#include "common/vpl_visibility.glsl"

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform float longest;  // the scene's diagonal [world units]

// The map entry for a direction in which the VPL sees nothing, or nobody looks.
uvec2 visibility_nothing(vec3 axis) {
    return visibility_texel(VISIBILITY_NOTHING * longest / scene_length, -axis);
}

// The map entry for one ray from a VPL; `axis` is its unit direction in the VPL's frame. A VPL without flux casts none.
uvec2 cast_visibility_texel(VirtualPointLight vpl, vec3 axis) {
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 direction = frame * axis;
    RayHit hit = RayHit(longest, RAY_NO_TRIANGLE, 0u);
    if (any(greaterThan(vpl.flux.rgb, vec3(0.0)))) {
        hit = ray_hit(visibility_origin(vpl), direction, longest);
    }
    if (hit.triangle == RAY_NO_TRIANGLE) {
        return visibility_nothing(axis);
    }
    return visibility_texel(hit.distance / scene_length, ray_hit_normal(hit, direction) * frame);
}
