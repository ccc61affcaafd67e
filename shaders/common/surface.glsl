// The surface under a fragment: albedo and the two normals.

in vec3 position_world;
in vec3 normal_world;
in vec2 uv;
in vec3 base_color;

uniform sampler2D base_color_texture;
uniform ivec2 mirrored;  // 1 where the texture repeats mirrored, which OpenGL samplers of moderngl lack

vec3 surface_albedo() {
    vec2 dx = dFdx(uv);
    vec2 dy = dFdy(uv);
    vec2 folded = 1.0 - abs(mod(uv, 2.0) - 1.0);
    vec2 lookup = mix(uv, folded, vec2(mirrored));
    return clamp(base_color * textureGrad(base_color_texture, lookup, dx, dy).rgb, 0.0, 1.0);
}

// The plane of the triangle, turned towards `eye_world`.
vec3 geometric_normal(vec3 to_eye) {
    vec3 normal = cross(dFdx(position_world), dFdy(position_world));
    // Slivers have no area in a pixel quad: face the eye, the neighbourhood of which they are seen from.
    float length_squared = dot(normal, normal);
    normal = length_squared > 0.0 ? normal * inversesqrt(length_squared) : normalize(to_eye);
    return dot(normal, to_eye) < 0.0 ? -normal : normal;
}

// The interpolated normal, turned towards `eye_world` (every surface is two-sided).
vec3 shading_normal(vec3 to_eye, vec3 normal_geometric) {
    float length_squared = dot(normal_world, normal_world);
    if (!(length_squared > 0.0)) {
        return normal_geometric;
    }
    vec3 normal = normal_world * inversesqrt(length_squared);
    return dot(normal, to_eye) < 0.0 ? -normal : normal;
}
