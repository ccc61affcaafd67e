// Holes in the surfaces that rays meet, and surfaces that let a share of the rays pass.
//
// Provides: `ray_meets_surface`, `ray_seed`. Needs common/ray_intersection.glsl.
// Python: renderer/gpu/ray_alpha.py, which lays out the words.

layout(std430, binding = RAY_ALPHA_BINDING) readonly buffer RayAlpha {
    uint ray_alpha[];
};

#include "common/hash.glsl"

// Which numbers decide at blended surfaces: one for each ray, set before it is cast, and the same in every frame.
uint ray_seed = 0u;

// The texel below a coordinate. `wrap`: 0 repeat, 1 mirrored, 2 clamped.
uint ray_texel(float coordinate, uint size, uint wrap) {
    float folded = wrap == 1u ? 1.0 - abs(mod(coordinate, 2.0) - 1.0) : wrap == 0u ? fract(coordinate) : coordinate;
    return uint(clamp(int(floor(folded * float(size))), 0, int(size) - 1));
}

// Opacity in [0, 1] of a material at texture coordinates: that of the nearest texel.
float ray_opacity(uint material, vec2 uv) {
    uint width = ray_alpha[material + 3u];
    uint column = ray_texel(uv.x, width, ray_alpha[material + 5u]);
    uint row = ray_texel(uv.y, ray_alpha[material + 4u], ray_alpha[material + 6u]);
    uint texel = row * width + column;
    uint four = ray_alpha[ray_alpha[material + 2u] + texel / 4u];
    return uintBitsToFloat(ray_alpha[material]) * float((four >> (8u * (texel % 4u))) & 255u) * (1.0 / 255.0);
}

// Texture coordinates of a point of a triangle; the triangle's own begin at the word `place`.
vec2 ray_uv(RayTriangle triangle, uint place, vec3 point) {
    vec3 to_b = triangle.b - triangle.a;
    vec3 to_c = triangle.c - triangle.a;
    vec3 across = cross(to_b, to_c);
    vec3 size = abs(across);
    // The division keeps the products of a tiny triangle within float32.
    vec3 along = across / max(max(size.x, size.y), max(size.z, 1e-30));
    float area = max(dot(across, along), 1e-30);
    float of_b = dot(cross(point - triangle.a, to_c), along) / area;
    float of_c = dot(cross(to_b, point - triangle.a), along) / area;
    vec2 corners[3];
    for (uint i = 0u; i < 3u; ++i) {
        corners[i] = vec2(uintBitsToFloat(ray_alpha[place + 2u * i]), uintBitsToFloat(ray_alpha[place + 2u * i + 1u]));
    }
    return corners[0] + of_b * (corners[1] - corners[0]) + of_c * (corners[2] - corners[0]);
}

// Whether there is a surface, and not a hole, where a ray meets a triangle. `surface` is what the instance says: the
// word of triangle 0's coordinates, and one more than the word of the material, or 0 where all is opaque.
bool ray_meets_surface(
    uvec2 surface, uint instance, uint index, RayTriangle triangle, SpaceRay ray, float distance_along) {
    if (surface.y == 0u) {
        return true;
    }
    uint material = surface.y - 1u;
    vec2 uv = ray_uv(triangle, surface.x + 6u * index, ray.origin + distance_along * ray.direction);
    float opacity = ray_opacity(material, uv);
    if (ray_alpha[material + 7u] != 0u) {
        return unit_number(hashed(index ^ hashed(instance ^ hashed(ray_seed)))) < opacity;
    }
    return opacity >= uintBitsToFloat(ray_alpha[material + 1u]);
}
