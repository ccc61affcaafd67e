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

// A batch of VPLs: position, area (0 where dark); normal.
shared vec4 positions_lit[64];
shared vec3 normals[64];

void main() {
    int index = int(gl_GlobalInvocationID.x);
    int lane = int(gl_LocalInvocationIndex);
    VirtualPointLight own = vpl_samples[min(index, sample_count - 1)];
    float length_squared = scene_length * scene_length;
    float nearest = 1e30;
    int owner = -1;
    for (int start = 0; start < vpl_count; start += 64) {
        if (start + lane < vpl_count) {
            VirtualPointLight vpl = virtual_point_lights[start + lane];
            positions_lit[lane] = vec4(vpl.position_footprint.xyz, vpl.normal_area.w);
            normals[lane] = vpl.normal_area.xyz;
        }
        barrier();
        int count = min(64, vpl_count - start);
        for (int i = 0; i < count; ++i) {
            vec3 between = own.position_footprint.xyz - positions_lit[i].xyz;
            float away = cluster_distance(between, own.normal_area.xyz, normals[i], length_squared);
            if (away < nearest && positions_lit[i].w > 0.0) {
                nearest = away;
                owner = start + i;
            }
        }
        barrier();
    }
    // A dark sample belongs to no VPL.
    if (index < sample_count && own.normal_area.w > 0.0 && owner >= 0) {
        atomicOr(vpl_members[owner * member_words() + index / 32], 1u << uint(index % 32));
    }
}
