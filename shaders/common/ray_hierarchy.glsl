// Rays against the scene as it stands: two levels of boxes, instances above triangles. Every surface is
// two-sided. No length is absolute: a caller moves the origin off the surface that it starts from.

#include "common/ray_intersection.glsl"

// Nodes stand in pairs, the two children of one parent. `child`: the number of items in a leaf in the low
// RAY_COUNT_BITS, above them the first item; for an inner node 0, above it the first node of its own pair.
struct RayNode {
    vec3 low;
    uint child;
    vec3 high;
    uint padding;
};

struct RayInstance {
    mat3x4 world_to_instance;  // columns are the rows of the affine matrix
    uvec4 root;                // as `child` of a node; the rest is unused
};

layout(std430, binding = RAY_NODES_BINDING) readonly buffer RayNodes {
    RayNode ray_nodes[];  // the tree over instances, then the trees of the meshes
};

layout(std430, binding = RAY_TRIANGLES_BINDING) readonly buffer RayTriangles {
    RayTriangle ray_triangles[];
};

layout(std430, binding = RAY_INSTANCES_BINDING) readonly buffer RayInstances {
    RayInstance ray_instances[];
};

const uint RAY_COUNT_MASK = (1u << RAY_COUNT_BITS) - 1u;
// Not leaves: more items than any leaf has.
const uint RAY_DONE = 0xFFFFFFFFu;
const uint RAY_LEAVE_INSTANCE = 0xFFFFFFFEu;

// The nearest surface on a ray.
struct RayHit {
    float distance;
    uint triangle;  // RAY_NO_TRIANGLE where nothing is met
    uint instance;
};

const uint RAY_NO_TRIANGLE = 0xFFFFFFFFu; // not the index of a triangle

// What the unit direction meets first; nothing farther than `longest`, which is then the distance.
RayHit ray_hit(vec3 origin_world, vec3 direction_world, float longest) {
    uint stack[RAY_STACK_SIZE];
    int height = 1;
    stack[0] = RAY_DONE;
    float nearest = min(longest, 0.5 * RAY_MISS);
    SpaceRay ray = space_ray(origin_world, direction_world);
    bool in_instance = false;
    uint instance = 0u;
    RayHit hit = RayHit(longest, RAY_NO_TRIANGLE, 0u);
    uint current = 0u;
    while (true) {
        while ((current & RAY_COUNT_MASK) == 0u) {
            uint pair = current >> RAY_COUNT_BITS;
            RayNode left = ray_nodes[pair];
            RayNode right = ray_nodes[pair + 1u];
            float to_left = box_distance(ray, left.low, left.high, nearest);
            float to_right = box_distance(ray, right.low, right.high, nearest);
            bool right_first = to_right < to_left;
            current = right_first ? right.child : left.child;
            stack[height] = right_first ? left.child : right.child;
            height += int(max(to_left, to_right) < RAY_MISS);
            if (min(to_left, to_right) >= RAY_MISS) {
                current = stack[--height];
            }
        }
        if (current == RAY_DONE) {
            break;
        }
        uint first = current >> RAY_COUNT_BITS;
        if (current == RAY_LEAVE_INSTANCE) {
            ray = space_ray(origin_world, direction_world);
            in_instance = false;
            current = stack[--height];
        } else if (in_instance) {
            uint end = first + (current & RAY_COUNT_MASK);
            for (uint i = first; i < end; ++i) {
                float met = triangle_distance(ray, ray_triangles[i], nearest);
                if (met < nearest) {
                    nearest = met;
                    hit = RayHit(met, i, instance);
                }
            }
            current = stack[--height];
        } else {
            instance = first;
            mat3x4 world_to_instance = ray_instances[first].world_to_instance;
            ray = space_ray(
                vec4(origin_world, 1.0) * world_to_instance, vec4(direction_world, 0.0) * world_to_instance);
            in_instance = true;
            stack[height++] = RAY_LEAVE_INSTANCE;
            current = ray_instances[first].root.x;
        }
    }
    return hit;
}

// Unit normal in the world of the triangle that was met, towards the ray's origin.
vec3 ray_hit_normal(RayHit hit, vec3 direction_world) {
    RayTriangle triangle = ray_triangles[hit.triangle];
    vec3 across = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    // Normals go by the inverse transpose of what positions go by. Scaled first: tiny triangles have tiny
    // cross products.
    vec3 size = abs(across);
    across /= max(max(size.x, size.y), max(size.z, 1e-30));
    vec3 normal = normalize((ray_instances[hit.instance].world_to_instance * across).xyz);
    return dot(normal, direction_world) > 0.0 ? -normal : normal;
}
