// Rays against the scene as it stands: two levels of boxes, instances above triangles. Every surface is
// two-sided. No length is absolute: a caller moves the origin off the surface that it starts from.

// Nodes stand in pairs, the two children of one parent. `child`: the number of items in a leaf in the low
// RAY_COUNT_BITS, above them the first item; for an inner node 0, above it the first node of its own pair.
struct RayNode {
    vec3 low;
    uint child;
    vec3 high;
    uint padding;
};

struct RayTriangle {  // in the mesh's own space
    vec3 a;
    vec3 b;
    vec3 c;
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
const float RAY_MISS = 3.4e38;

// A ray in the space of an instance, whose direction need not be of unit length there: distances along it
// stay those of the world.
struct SpaceRay {
    vec3 origin;
    vec3 direction;
    vec3 inverse_direction;
};

SpaceRay space_ray(vec3 origin, vec3 direction) {
    vec3 size = abs(direction);
    float longest = max(size.x, max(size.y, size.z));
    // A ray along a face of a box would have 0 · ∞; this bends it by less than rounding does.
    vec3 bent = mix(direction, vec3(1e-8 * longest), lessThan(size, vec3(1e-8 * longest)));
    return SpaceRay(origin, direction, 1.0 / bent);
}

// Where the ray enters the box, or RAY_MISS.
float box_distance(SpaceRay ray, vec3 low, vec3 high, float longest) {
    vec3 to_low = (low - ray.origin) * ray.inverse_direction;
    vec3 to_high = (high - ray.origin) * ray.inverse_direction;
    vec3 first = min(to_low, to_high);
    vec3 last = max(to_low, to_high);
    float entry = max(max(first.x, first.y), max(first.z, 0.0));
    // Four roundings may shorten the way out (Ize 2013).
    float leave = min(min(last.x, last.y), last.z) * 1.0000005;
    return entry <= min(leave, longest) ? entry : RAY_MISS;
}

// The three axes in their order, the longest of the direction last.
vec3 longest_last(vec3 value, vec3 size) {
    bool x = size.x > size.y && size.x > size.z;
    bool y = !x && size.y > size.z;
    return x ? value.yzx : y ? value.zxy : value;
}

// Watertight (Woop, Benthin and Wald 2013): the ray becomes the z axis by a shear, so that two triangles see
// their common edge through the same numbers.
float triangle_distance(SpaceRay ray, RayTriangle triangle, float longest) {
    vec3 size = abs(ray.direction);
    vec3 along = longest_last(ray.direction, size);
    vec2 shear = along.xy / along.z;
    vec3 a = longest_last(triangle.a - ray.origin, size);
    vec3 b = longest_last(triangle.b - ray.origin, size);
    vec3 c = longest_last(triangle.c - ray.origin, size);
    precise vec2 a_sheared = a.xy - shear * a.z;
    precise vec2 b_sheared = b.xy - shear * b.z;
    precise vec2 c_sheared = c.xy - shear * c.z;
    precise float u = c_sheared.x * b_sheared.y - c_sheared.y * b_sheared.x;
    precise float v = a_sheared.x * c_sheared.y - a_sheared.y * c_sheared.x;
    precise float w = b_sheared.x * a_sheared.y - b_sheared.y * a_sheared.x;
    float determinant = u + v + w;
    float t = (u * a.z + v * b.z + w * c.z) / (determinant * along.z);
    bool inside = min(u, min(v, w)) >= 0.0 || max(u, max(v, w)) <= 0.0;
    return inside && determinant != 0.0 && t > 0.0 && t < longest ? t : longest;
}

// The nearest surface on a ray.
struct RayHit {
    float distance;
    uint triangle;  // RAY_NO_TRIANGLE where nothing is met
    uint instance;
};

const uint RAY_NO_TRIANGLE = 0xFFFFFFFFu;

RayHit traverse_rays(vec3 origin_world, vec3 direction_world, float longest, bool any_hit) {
    uint stack[RAY_STACK_SIZE];
    int height = 1;
    stack[0] = RAY_DONE;
    float nearest = min(longest, 0.5 * RAY_MISS);
    float reach = nearest;
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
            if (any_hit && nearest < reach) {
                break;
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

// What the unit direction meets first; nothing farther than `longest`.
RayHit ray_hit(vec3 origin_world, vec3 direction_world, float longest) {
    return traverse_rays(origin_world, direction_world, longest, false);
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

// Distance along the unit direction to the nearest surface; `longest` where there is none nearer.
float ray_distance(vec3 origin_world, vec3 direction_world, float longest) {
    return traverse_rays(origin_world, direction_world, longest, false).distance;
}

// Whether anything stands on the unit direction nearer than `longest`.
bool ray_blocked(vec3 origin_world, vec3 direction_world, float longest) {
    return traverse_rays(origin_world, direction_world, longest, true).triangle != RAY_NO_TRIANGLE;
}
