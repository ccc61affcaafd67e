// VPL cells, part 2: each VPL takes the light of its cell, and stands in its middle. One workgroup for each VPL.
#include "common/scene_length.glsl"
#include "common/vpl_cells.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int sample_count;

const float PI = 3.14159265358979;

shared vec4 offsets_counts[64];   // from where the VPL was, near to which nothing is rounded off
shared vec4 normals_squares[64];  // squares: of the offset, and half of the sample's own disc's
shared vec4 fluxes[64];
shared float distances[64];
shared int nearest_samples[64];

void sum_lanes(int lane) {
    for (int reach = 32; reach > 0; reach /= 2) {
        barrier();
        if (lane < reach) {
            offsets_counts[lane] += offsets_counts[lane + reach];
            normals_squares[lane] += normals_squares[lane + reach];
            fluxes[lane] += fluxes[lane + reach];
        }
    }
    barrier();
}

// The sample that is nearest to the middle; among equals the first.
int sample_nearest_to(int vpl_index, int lane, vec3 middle, vec3 normal) {
    float nearest = 1e30;
    int found = -1;
    for (int i = lane; i < sample_count; i += 64) {
        if (vpl_owners[i] == vpl_index) {
            VirtualPointLight one = vpl_samples[i];
            float away = cell_distance(
                one.position_footprint.xyz - middle, one.normal_area.xyz, normal, scene_length * scene_length);
            if (away < nearest) {
                nearest = away;
                found = i;
            }
        }
    }
    distances[lane] = nearest;
    nearest_samples[lane] = found;
    for (int reach = 32; reach > 0; reach /= 2) {
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
    vec4 offset_count = vec4(0.0);
    vec4 normal_square = vec4(0.0);
    vec4 flux = vec4(0.0);
    for (int i = lane; i < sample_count; i += 64) {
        if (vpl_owners[i] == vpl_index) {
            VirtualPointLight one = vpl_samples[i];
            vec3 offset = one.position_footprint.xyz - before;
            offset_count += vec4(offset, 1.0);
            normal_square += vec4(
                one.normal_area.xyz, dot(offset, offset) + 0.5 * one.position_footprint.w * one.position_footprint.w);
            flux += one.flux;
        }
    }
    offsets_counts[lane] = offset_count;
    normals_squares[lane] = normal_square;
    fluxes[lane] = flux;
    sum_lanes(lane);
    float count = offsets_counts[0].w;
    vec3 offset = offsets_counts[0].xyz / max(count, 1.0);
    // Normals that cancel leave the distance to decide.
    vec3 normal = normals_squares[0].xyz / max(length(normals_squares[0].xyz), 1e-30);
    int middle = sample_nearest_to(vpl_index, lane, before + offset, normal);
    if (lane != 0) {
        return;
    }
    VirtualPointLight vpl = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));
    if (middle >= 0) {
        VirtualPointLight one = vpl_samples[middle];
        // To the middle itself over the plane of the sample next to it, but within that sample's disc: the middle of
        // what surrounds a box lies in the box.
        vec3 slide = before + offset - one.position_footprint.xyz;
        slide -= one.normal_area.xyz * dot(one.normal_area.xyz, slide);
        slide *= min(1.0, one.position_footprint.w / max(length(slide), 1e-30));
        // A disc has a spread of half its radius squared.
        float spread = max(normals_squares[0].w / count - dot(offset, offset), 0.0);
        vpl.position_footprint = vec4(one.position_footprint.xyz + slide, sqrt(2.0 * spread));
        vpl.normal_area = vec4(one.normal_area.xyz, 2.0 * PI * spread);
        vpl.flux = fluxes[0];
    }
    virtual_point_lights[vpl_index] = vpl;
}
