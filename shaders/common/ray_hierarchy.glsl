// Ray tracing in compute shaders: the nearest triangle along a ray, through two levels of bounding boxes, a tree over
// instances above one tree for each mesh.
//
// Provides: `ray_hit`, `ray_hit_albedo`, `ray_hit_normal`. Every surface is two-sided. There is no self-intersection offset in here: the
// caller moves the origin off the surface that the ray starts from.
// Constants: RAY_COUNT_BITS (renderer/gpu/bounding_volumes.py), RAY_STACK_SIZE (renderer/gpu/ray_hierarchy.py).
// Python: renderer/gpu/ray_hierarchy.py. Test against every triangle in float64: tests/support/traced_rays.py.

#include "common/ray_intersection.glsl"
#ifdef RAYS_MEET_HOLES
#include "common/ray_alpha.glsl"
#endif

// A box and what it holds. Nodes stand in pairs, the two children of one parent. The low RAY_COUNT_BITS of `child` hold
// the number of items of a leaf, and the bits above hold its first item. For an inner node the number is 0 and the bits
// above hold the first node of its pair of children.
struct RayNode {
    vec3 low;
    uint child;
    vec3 high;
    uint padding;
};

struct RayInstance {
    mat3x4 world_to_instance;  // columns are the rows of the affine matrix
    uvec4 root;                // x: root of the mesh's tree, as `child` of a node; y, z: as common/ray_alpha.glsl says
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

// The bits of `child` that hold a leaf's number of items.
const uint RAY_COUNT_MASK = (1u << RAY_COUNT_BITS) - 1u;
// Stack entries that are no nodes: the end of the traversal, and the way back to world space. Their low bits give a
// number of items that no leaf has.
const uint RAY_DONE = 0xFFFFFFFFu;
const uint RAY_LEAVE_INSTANCE = 0xFFFFFFFEu;

// The nearest surface along a ray.
struct RayHit {
    float distance;
    uint triangle;  // RAY_NO_TRIANGLE where the ray hits nothing
    uint instance;
};

// The largest uint: no scene has that many triangles.
const uint RAY_NO_TRIANGLE = 0xFFFFFFFFu;

// The first hit along a unit direction within `longest`, or RAY_NO_TRIANGLE at distance `longest`.
RayHit ray_hit(vec3 origin_world, vec3 direction_world, float longest) {
    uint stack[RAY_STACK_SIZE];
    int height = 1;
    stack[0] = RAY_DONE;
    float nearest = min(longest, 0.5 * RAY_MISS);
    SpaceRay ray = space_ray(origin_world, direction_world);
    bool in_instance = false;
    uint instance = 0u;
    RayHit hit = RayHit(longest, RAY_NO_TRIANGLE, 0u);
    uint current = 0u;  // the pair at 0: the root of the tree over instances
    while (true) {
        while ((current & RAY_COUNT_MASK) == 0u) {
            uint pair = current >> RAY_COUNT_BITS;
            RayNode left = ray_nodes[pair];
            RayNode right = ray_nodes[pair + 1u];
            float to_left = box_distance(ray, left.low, left.high, nearest);
            float to_right = box_distance(ray, right.low, right.high, nearest);
            bool right_first = to_right < to_left;
            current = right_first ? right.child : left.child;
            // Written in any case, and kept only if the ray meets both boxes.
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
#ifdef RAYS_MEET_HOLES
                if (met < nearest
                    && !ray_meets_surface(
                        ray_instances[instance].root.yz, instance, i, ray_triangles[i], ray, met)) {
                    met = nearest;
                }
#endif
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

// Mean albedo of the triangle that was hit.
vec3 ray_hit_albedo(RayHit hit) {
    RayTriangle triangle = ray_triangles[hit.triangle];
    return vec3(triangle.albedo_red, triangle.albedo_green, triangle.albedo_blue);
}

// Unit normal of the triangle that was hit, in the world, on the side of the ray's origin.
vec3 ray_hit_normal(RayHit hit, vec3 direction_world) {
    RayTriangle triangle = ray_triangles[hit.triangle];
    vec3 across = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    // Normals transform by the inverse transpose of the matrix for positions. The division keeps the cross product of a
    // tiny triangle within float32.
    vec3 size = abs(across);
    across /= max(max(size.x, size.y), max(size.z, 1e-30));
    vec3 normal = normalize((ray_instances[hit.instance].world_to_instance * across).xyz);
    return dot(normal, direction_world) > 0.0 ? -normal : normal;
}
