// The samples that clustered disc lights are made from, and the VPL that each sample belongs to.
// Needs common/virtual_point_lights.glsl. Python: renderer/frame/passes/clustered_discs.py.

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

layout(std430, binding = VPL_OWNERS_BINDING) buffer VplOwners {
    int vpl_owners[];  // of each sample; -1 where it is dark
};
