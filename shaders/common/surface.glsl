// The surface under a fragment: albedo, geometric normal and shading normal.
//
// Provides: `surface_albedo`, `geometric_normal`, `shading_normal`.
// Reads: the outputs of geometry.vert, reflective_shadow_map.vert or web/scene.vert, and the base colour texture.

in vec3 position_world;
in vec3 normal_world;
in vec2 uv;
in vec3 base_color;

uniform sampler2D base_color_texture;
uniform ivec2 mirrored;  // 1 where the texture repeats mirrored, which OpenGL samplers of moderngl lack

// Where the texture is looked up.
vec2 texture_place() {
    vec2 folded = 1.0 - abs(mod(uv, 2.0) - 1.0);
    return mix(uv, folded, vec2(mirrored));
}

// Albedo in [0, 1]: base colour times texture. Gradients come from `uv` before mirroring, which has a crease.
vec3 surface_albedo() {
    vec2 dx = dFdx(uv);
    vec2 dy = dFdy(uv);
    return clamp(base_color * textureGrad(base_color_texture, texture_place(), dx, dy).rgb, 0.0, 1.0);
}

// Unit normal of the triangle, turned towards the viewer (the camera or the light).
vec3 geometric_normal(vec3 to_eye) {
    vec3 normal = cross(dFdx(position_world), dFdy(position_world));
    // The derivatives of a sliver may be parallel. Then the normal is the direction to the viewer.
    float length_squared = dot(normal, normal);
    normal = length_squared > 0.0 ? normal * inversesqrt(length_squared) : normalize(to_eye);
    return dot(normal, to_eye) < 0.0 ? -normal : normal;
}

// Unit interpolated normal, turned towards the viewer, since every surface is two-sided.
vec3 shading_normal(vec3 to_eye, vec3 normal_geometric) {
    float length_squared = dot(normal_world, normal_world);
    if (!(length_squared > 0.0)) {
        return normal_geometric;
    }
    vec3 normal = normal_world * inversesqrt(length_squared);
    return dot(normal, to_eye) < 0.0 ? -normal : normal;
}
