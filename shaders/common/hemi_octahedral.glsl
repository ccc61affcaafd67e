// Unit vectors of the upper hemisphere (z >= 0) on the square [-1, 1]², without a crease (Cigolle et al. 2014,
// "hemi-oct"). Twin: tuner/surrogate/vpl_visibility.py.

vec2 hemi_octahedral_encode(vec3 direction) {
    vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + direction.z);
    return vec2(p.x + p.y, p.x - p.y);
}

vec3 hemi_octahedral_decode(vec2 encoded) {
    vec2 p = vec2(encoded.x + encoded.y, encoded.x - encoded.y) * 0.5;
    return normalize(vec3(p, 1.0 - abs(p.x) - abs(p.y)));
}

// Tangents that make a right-handed frame with a unit normal (Duff et al. 2017). They turn over between two parts of
// the sphere.
mat3 hemisphere_frame(vec3 normal) {
    float s = normal.z >= FRAME_TURNS_OVER ? 1.0 : -1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    return mat3(
        vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x),
        vec3(b, s + normal.y * normal.y * a, -normal.y),
        normal);
}
