// The samples that clustered disc lights are made from, and the VPL that each sample belongs to.
// Needs common/virtual_point_lights.glsl. Python: renderer/frame/passes/clustered_discs.py.

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

layout(std430, binding = VPL_OWNERS_BINDING) buffer VplOwners {
    int vpl_owners[];  // for each sample, the index of its VPL; -1 for a dark sample
};
