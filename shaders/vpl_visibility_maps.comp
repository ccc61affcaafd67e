// A small map of the surfaces each VPL sees: one ray for each texel of its hemisphere, through the hierarchy.
// One workgroup for each VPL.
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"
#include "common/ray_hierarchy.glsl"
#include "common/vpl_visibility.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform float longest;  // the scene's diagonal [world units]

void main() {
    int vpl_index = int(gl_WorkGroupID.x);
    VirtualPointLight vpl = virtual_point_lights[vpl_index];
    bool lit = any(greaterThan(vpl.flux.rgb, vec3(0.0)));
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 origin = visibility_origin(vpl, scene_length);
    const int texels = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;
    for (int i = int(gl_LocalInvocationIndex); i < texels; i += 64) {
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
        vec3 axis = visibility_axis(texel);
        vec3 direction = frame * axis;
        RayHit hit = RayHit(longest, RAY_NO_TRIANGLE, 0u);
        if (lit) {
            hit = ray_hit(origin, direction, longest);
        }
        // What meets nothing ends twice the scene away, at a wall that faces the VPL: no receiver is behind it.
        bool met = hit.triangle != RAY_NO_TRIANGLE;
        float end = met ? hit.distance : 2.0 * longest;
        vec3 normal = met ? ray_hit_normal(hit, direction) * frame : -axis;
        visibility_maps[vpl_index * texels + i] = visibility_texel(end / scene_length, normal);
    }
}
