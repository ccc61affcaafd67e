// The mean footprint of the frame's VPLs: the radius of a disc of their mean area. One workgroup.
//
// Reads: VPLs. Writes: `mean_vpl_footprint` [world units]. Python: renderer/frame/passes/screen_space_indirect.py.
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

layout(std430, binding = VPL_FOOTPRINT_BINDING) writeonly buffer VplFootprint {
    float mean_vpl_footprint;
};

uniform int vpl_count;

shared float areas[256];

const float PI = 3.14159265358979;

void main() {
    int lane = int(gl_LocalInvocationIndex);
    float area = 0.0;
    for (int i = lane; i < vpl_count; i += 256) {
        area += virtual_point_lights[i].normal_area.w;
    }
    areas[lane] = area;
    barrier();
    for (int reach = 128; reach > 0; reach /= 2) {
        if (lane < reach) { areas[lane] += areas[lane + reach]; }
        barrier();
    }
    if (lane == 0) {
        mean_vpl_footprint = sqrt(areas[0] / (PI * float(vpl_count)));
    }
}
