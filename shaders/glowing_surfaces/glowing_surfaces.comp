// Glowing surfaces, part 2: draws samples from their triangles by power, at the points of a table.
//
// Reads: the triangles, what places them, the running sum of part 1, the point table.
// Writes: samples, as VPLs whose flux is what they emit. One invocation for each.
// Python: renderer/frame/passes/glowing_surfaces.py.
#include "common/glowing_triangles.glsl"
#include "common/point_table.glsl"
#include "common/virtual_point_lights.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = GLOWING_CDF_BINDING) readonly buffer GlowingCdf {
    float glowing_cdf[];
};

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) writeonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int triangle_count;
uniform int sample_count;
uniform vec2 table_rotation;  // as in virtual_point_lights.comp

const float PI = 3.14159265358979;

// The first triangle whose running sum exceeds `target`.
int triangle_above(float target) {
    int low = 0;
    int high = triangle_count - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (glowing_cdf[middle] > target) { high = middle; } else { low = middle + 1; }
    }
    return low;
}

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= sample_count) {
        return;
    }
    float total = glowing_cdf[triangle_count - 1];
    vec2 point = fract(point_table[index] + table_rotation);
    float target = point.x * total;
    int found = triangle_above(target);
    GlowingTriangle triangle = glowing_triangle(found);
    float power = glowing_power(triangle);
    if (!(power > 0.0)) {
        virtual_point_lights[index] = NO_VPL;
        return;
    }
    // What is left of the number, after it has chosen the triangle, chooses the side, and then the place.
    float before = found > 0 ? glowing_cdf[found - 1] : 0.0;
    float within = clamp((target - before) / max(glowing_cdf[found] - before, 1e-30), 0.0, 1.0) * triangle.sides;
    bool is_back = within >= 1.0;
    float along = sqrt(min(within - (is_back ? 1.0 : 0.0), 1.0));
    vec3 position = triangle.a + triangle.to_b * (along * (1.0 - point.y)) + triangle.to_c * (along * point.y);
    // Samples per unit of power. Each side has its share of the area.
    float draws = float(sample_count) * power / total;
    float area = triangle.area * triangle.sides / draws;
    virtual_point_lights[index] = VirtualPointLight(
        vec4(position, sqrt(area / PI)), vec4(is_back ? -triangle.normal : triangle.normal, area),
        vec4(triangle.radiance * (PI * area), 0.0));
}
