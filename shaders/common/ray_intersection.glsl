// Ray against box and ray against triangle, for a tree of bounding boxes.
//
// Provides: `space_ray`, `box_distance`, `triangle_distance`. Used by the runtime and by the web page.

// The distance of a miss: just below the largest float32, 3.403e38.
const float RAY_MISS = 3.4e38;

// The corners, in the mesh's own space, and the mean albedo in [0, 1].
struct RayTriangle {
    vec3 a;
    float albedo_red;
    vec3 b;
    float albedo_green;
    vec3 c;
    float albedo_blue;
};

// A ray in the space of an instance. Its direction is not normalised there, so distances along it stay those of the
// world.
struct SpaceRay {
    vec3 origin;
    vec3 direction;
    vec3 inverse_direction;
};

SpaceRay space_ray(vec3 origin, vec3 direction) {
    vec3 size = abs(direction);
    float longest = max(size.x, max(size.y, size.z));
    // A ray parallel to a face of a box would give 0 · ∞. A component below 1e-8 of the largest becomes that share,
    // which is less than float32 rounds (6e-8).
    vec3 bent = mix(direction, vec3(1e-8 * longest), lessThan(size, vec3(1e-8 * longest)));
    return SpaceRay(origin, direction, 1.0 / bent);
}

// The distance at which the ray enters the box, or RAY_MISS (slab test).
float box_distance(SpaceRay ray, vec3 low, vec3 high, float longest) {
    vec3 to_low = (low - ray.origin) * ray.inverse_direction;
    vec3 to_high = (high - ray.origin) * ray.inverse_direction;
    vec3 first = min(to_low, to_high);
    vec3 last = max(to_low, to_high);
    float entry = max(max(first.x, first.y), max(first.z, 0.0));
    // Rounding must not make the ray leave before it enters: four units in the last place more (Ize 2013).
    float leave = min(min(last.x, last.y), last.z) * 1.0000005;
    return entry <= min(leave, longest) ? entry : RAY_MISS;
}

// `value` with its axes rotated so that the largest component of `size` comes last.
vec3 longest_last(vec3 value, vec3 size) {
    bool x = size.x > size.y && size.x > size.z;
    bool y = !x && size.y > size.z;
    return x ? value.yzx : y ? value.zxy : value;
}

// The distance to the triangle, or `longest` where there is no nearer hit. Watertight (Woop, Benthin and Wald 2013): a
// shear turns the ray into the z axis, so that two triangles compute their common edge from the same numbers.
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
