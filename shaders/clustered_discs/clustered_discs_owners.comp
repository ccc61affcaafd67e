// Clustered disc lights, part 1 of a Lloyd iteration: finds the nearest VPL of each sample.
//
// Reads: samples, VPLs, the scene length. Writes: the members of each VPL. One invocation for each sample.
// Python: renderer/frame/passes/clustered_discs.py. Source: see common/clustered_discs.glsl.
#include "common/scene_length.glsl"

const float PI = 3.14159265358979;
#include "common/clustered_discs.glsl"
#include "common/clustered_discs_buffers.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int vpl_count;

void main() {
    int index = int(gl_GlobalInvocationID.x);
    // A dark sample belongs to no VPL.
    if (index >= sample_count || !(vpl_samples[index].normal_area.w > 0.0)) {
        return;
    }
    VirtualPointLight own = vpl_samples[index];
    float own_length = cluster_length(scene_length, own);
    float length_squared = own_length * own_length;
    float nearest = 1e30;
    int owner = -1;
    for (int i = 0; i < vpl_count; ++i) {
        VirtualPointLight vpl = virtual_point_lights[i];
        vec3 between = own.position_footprint.xyz - vpl.position_footprint.xyz;
        float away = cluster_distance(between, own.normal_area.xyz, vpl.normal_area.xyz, length_squared);
        if (away < nearest && vpl.normal_area.w > 0.0) {
            nearest = away;
            owner = i;
        }
    }
    if (owner >= 0) {
        atomicOr(vpl_members[owner * member_words() + index / 32], 1u << uint(index % 32));
    }
}
