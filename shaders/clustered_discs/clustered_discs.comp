// Clustered disc lights, part 2 of a Lloyd iteration: each VPL takes the light of its samples and moves to their
// centroid.
//
// Reads: samples, the scene length. Reads and clears: the members of each VPL. Writes: VPLs. One workgroup for each VPL.
// Python: renderer/frame/passes/clustered_discs.py. Source: see common/clustered_discs.glsl.
#include "common/scene_length.glsl"

const float PI = 3.14159265358979;
#include "common/clustered_discs.glsl"
#include "common/clustered_discs_buffers.glsl"

const int LANES = 32;  // A choice: most VPLs have fewer samples.

layout(local_size_x = LANES) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

shared ClusterSums sums[LANES];
shared float distances[LANES];
shared int nearest_samples[LANES];

// Add up `sums` over the workgroup, into sums[0].
void sum_lanes(int lane) {
    for (int reach = LANES / 2; reach > 0; reach /= 2) {
        barrier();
        if (lane < reach) {
            sums[lane] = joined(sums[lane], sums[lane + reach]);
        }
    }
    barrier();
}

// The sample of the VPL's cluster that is nearest to the centroid; the first of equally near ones; -1 without any.
int sample_nearest_to(int first_word, int lane, vec3 middle, vec3 normal) {
    float nearest = 1e30;
    int found = -1;
    for (int word = lane; word < member_words(); word += LANES) {
        for (uint members = vpl_members[first_word + word]; members != 0u; members &= members - 1u) {
            int index = 32 * word + findLSB(members);
            VirtualPointLight one = vpl_samples[index];
            float one_length = cluster_length(scene_length, one);
            float away = middle_distance(
                one.position_footprint.xyz - middle, one.normal_area.xyz, normal, one_length * one_length);
            if (away < nearest) {
                nearest = away;
                found = index;
            }
        }
        vpl_members[first_word + word] = 0u;
    }
    distances[lane] = nearest;
    nearest_samples[lane] = found;
    for (int reach = LANES / 2; reach > 0; reach /= 2) {
        barrier();
        if (lane < reach) {
            int other = lane + reach;
            bool first = nearest_samples[other] < nearest_samples[lane];
            if (distances[other] < distances[lane] || (distances[other] == distances[lane] && first)) {
                distances[lane] = distances[other];
                nearest_samples[lane] = nearest_samples[other];
            }
        }
    }
    barrier();
    return nearest_samples[0];
}

void main() {
    int vpl_index = int(gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationIndex);
    vec3 before = virtual_point_lights[vpl_index].position_footprint.xyz;
    ClusterSums own = NO_SAMPLES;
    int first_word = vpl_index * member_words();
    for (int word = lane; word < member_words(); word += LANES) {
        for (uint members = vpl_members[first_word + word]; members != 0u; members &= members - 1u) {
            own = with_sample(own, vpl_samples[32 * word + findLSB(members)], before);
        }
    }
    sums[lane] = own;
    sum_lanes(lane);
    int middle = sample_nearest_to(first_word, lane, before + cluster_offset(sums[0]), cluster_normal(sums[0]));
    if (lane == 0) {
        virtual_point_lights[vpl_index] = middle >= 0 ? clustered_disc(sums[0], before, vpl_samples[middle]) : NO_VPL;
    }
}
