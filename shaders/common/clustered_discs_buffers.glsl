// The samples that clustered disc lights are made from, and the samples that belong to each VPL.
// Needs common/virtual_point_lights.glsl. Python: renderer/frame/passes/clustered_discs.py.

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

// A row of bits for each VPL, one bit for each sample: set where the sample belongs to the VPL. Bits are in the order of
// samples whichever invocation sets them first, so sums over them repeat to the last bit.
layout(std430, binding = VPL_MEMBERS_BINDING) buffer VplMembers {
    uint vpl_members[];  // [vpls, member_words]; zero between Lloyd iterations
};

uniform int sample_count;

// Words of a row.
int member_words() {
    return (sample_count + 31) / 32;
}
