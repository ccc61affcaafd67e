// Web page: one ray of a VPL's visibility map, through a single tree of boxes over all triangles in world space.
//
// Provides: `cast_visibility_texel`. Runtime: common/visibility_ray.glsl.
// Constants: RAY_COUNT_BITS, RAY_STACK_SIZE, RAY_ROOT and DATA_COLUMNS of renderer/export/web_page/web_page.py.
#include "common/virtual_point_lights.glsl"
#include "common/ray_intersection.glsl"
#include "web/scene_length.glsl"
#include "web/visibility_atlas.glsl"
#include "web/vpl_texture.glsl"

uniform usampler2D ray_nodes;      // two texels each: low corner and child, high corner
uniform sampler2D ray_triangles;   // three texels each
uniform int vpl_count;
uniform float longest;

// As in common/ray_hierarchy.glsl.
const uint RAY_COUNT_MASK = (1u << RAY_COUNT_BITS) - 1u;
const uint RAY_DONE = 0xFFFFFFFFu; // neither a node nor a triangle

// The texel that holds the element at `index` of a data texture.
ivec2 data_texel(uint index) {
    return ivec2(int(index) % DATA_COLUMNS, int(index) / DATA_COLUMNS);
}

RayTriangle triangle_at(uint index) {
    vec4 a = texelFetch(ray_triangles, data_texel(3u * index), 0);
    vec4 b = texelFetch(ray_triangles, data_texel(3u * index + 1u), 0);
    vec4 c = texelFetch(ray_triangles, data_texel(3u * index + 2u), 0);
    return RayTriangle(a.xyz, a.w, b.xyz, b.w, c.xyz, c.w);
}

// The distance at which the ray enters a node's box, or RAY_MISS; and the node's child.
float node_distance(SpaceRay ray, uint node, float nearest, out uint child) {
    uvec4 low = texelFetch(ray_nodes, data_texel(2u * node), 0);
    uvec4 high = texelFetch(ray_nodes, data_texel(2u * node + 1u), 0);
    child = low.w;
    return box_distance(ray, uintBitsToFloat(low.xyz), uintBitsToFloat(high.xyz), nearest);
}

// The index of the nearest triangle on a ray within `nearest`, which becomes its distance; RAY_DONE without a hit.
uint nearest_triangle(SpaceRay ray, inout float nearest) {
    uint stack[RAY_STACK_SIZE];
    int height = 0;
    uint found = RAY_DONE;
    uint current = uint(RAY_ROOT);
    while (current != RAY_DONE) {
        uint count = current & RAY_COUNT_MASK;
        uint first = current >> RAY_COUNT_BITS;
        for (uint i = first; i < first + count; ++i) {
            float met = triangle_distance(ray, triangle_at(i), nearest);
            if (met < nearest) { nearest = met; found = i; }
        }
        uint next = RAY_DONE;
        if (count == 0u) {
            uint left_child, right_child;
            float left = node_distance(ray, first, nearest, left_child);
            float right = node_distance(ray, first + 1u, nearest, right_child);
            bool right_first = right < left;
            if (max(left, right) < RAY_MISS) { stack[height++] = right_first ? left_child : right_child; }
            if (min(left, right) < RAY_MISS) { next = right_first ? right_child : left_child; }
        }
        if (next == RAY_DONE && height > 0) { next = stack[--height]; }
        current = next;
    }
    return found;
}

// The map entry for one ray from a VPL; `axis` is its unit direction in the VPL's frame.
uvec2 cast_visibility_texel(VirtualPointLight vpl, vec3 axis) {
    float scene_length = measured_scene_length();
    mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
    vec3 direction = frame * axis;
    float nearest = longest;
    uint met = RAY_DONE;
    if (any(greaterThan(vpl.flux.rgb, vec3(0.0)))) {
        met = nearest_triangle(space_ray(visibility_origin(vpl), direction), nearest);
    }
    if (met == RAY_DONE) {
        return visibility_texel(VISIBILITY_NOTHING * longest / scene_length, -axis);
    }
    RayTriangle triangle = triangle_at(met);
    vec3 across = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    vec3 size = abs(across);
    vec3 plane = normalize(across / max(max(size.x, size.y), max(size.z, 1e-30)));
    return visibility_texel(nearest / scene_length, (dot(plane, direction) > 0.0 ? -plane : plane) * frame);
}
