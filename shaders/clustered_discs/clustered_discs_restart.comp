// Clustered disc lights in a clip, before each Lloyd iteration: a VPL without light starts anew.
//
// Reads: samples. Reads and writes: VPLs. One invocation for each VPL.
// Python: renderer/frame/passes/clustered_discs.py.
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = VPL_SAMPLES_BINDING) readonly buffer VplSamples {
    VirtualPointLight vpl_samples[];
};

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int vpl_count;

void main() {
    int index = int(gl_GlobalInvocationID.x);
    // No sample was near it, or the clip begins. It starts at its own sample, as in a still.
    if (index < vpl_count && !(virtual_point_lights[index].normal_area.w > 0.0)) {
        virtual_point_lights[index] = vpl_samples[index];
    }
}
