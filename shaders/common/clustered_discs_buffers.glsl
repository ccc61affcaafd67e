// What cells of light are made from.

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

layout(std430, binding = VPL_OWNERS_BINDING) buffer VplOwners {
    int vpl_owners[];  // of each sample; -1 where it is dark
};
