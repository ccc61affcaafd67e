// Glowing surfaces, part 1: the running sum of the power of their triangles. One workgroup.
//
// Reads: the triangles and what places them. Writes: `glowing_cdf` [π W].
// Constants: GLOWING_GROUP_SIZE. Python: renderer/frame/passes/glowing_surfaces.py.
#include "common/glowing_triangles.glsl"

layout(local_size_x = GLOWING_GROUP_SIZE) in;

layout(std430, binding = GLOWING_CDF_BINDING) buffer GlowingCdf {
    float glowing_cdf[];  // [triangles], inclusive
};

uniform int triangle_count;

shared float sums[GLOWING_GROUP_SIZE];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    // Each invocation sums a run of triangles of its own, in a fixed order, so that frames repeat bitwise.
    int run = (triangle_count + GLOWING_GROUP_SIZE - 1) / GLOWING_GROUP_SIZE;
    int begin = min(lane * run, triangle_count);
    int end = min(begin + run, triangle_count);
    float total = 0.0;
    for (int i = begin; i < end; ++i) {
        total += glowing_power(glowing_triangle(i));
        glowing_cdf[i] = total;
    }
    sums[lane] = total;
    barrier();
    float before = 0.0;
    for (int i = 0; i < lane; ++i) {
        before += sums[i];
    }
    for (int i = begin; i < end; ++i) {
        glowing_cdf[i] += before;
    }
}
