// Cells of light around VPLs: samples of the RSM, each of which belongs to the VPL that is nearest to it.
#include "common/virtual_point_lights.glsl"

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

layout(std430, binding = VPL_OWNERS_BINDING) buffer VplOwners {
    int vpl_owners[];  // of each sample; -1 where it is dark
};

// How far apart two surface elements are [L²]: opposite ones count 2 · NORMAL_REACH apart on top of their distance,
// so that a cell does not go round a corner, where light leaves in another direction.
float cell_distance(vec3 between, vec3 normal, vec3 other_normal, float length_squared) {
    return dot(between, between) / length_squared
         + 2.0 * NORMAL_REACH * NORMAL_REACH * (1.0 - dot(normal, other_normal));
}
