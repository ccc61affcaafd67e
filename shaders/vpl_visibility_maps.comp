// A small map of what each VPL sees: one ray for each texel of its hemisphere, through the scene's hierarchy.
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
    vec3 origin = visibility_origin(vpl);
    const int texels = VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE;
    for (int i = int(gl_LocalInvocationIndex); i < texels; i += 64) {
        ivec2 texel = ivec2(i % VISIBILITY_MAP_SIZE, i / VISIBILITY_MAP_SIZE);
        vec3 axis = hemi_octahedral_decode((vec2(texel) + 0.5) * (2.0 / float(VISIBILITY_MAP_SIZE)) - 1.0);
        float nearest = lit ? ray_distance(origin, frame * axis, longest) : longest;
        // What meets nothing is twice the scene away: farther than any receiver's plane that matters.
        visibility_maps[vpl_index * texels + i] = (nearest < longest ? nearest : 2.0 * longest) / scene_length;
    }
}
