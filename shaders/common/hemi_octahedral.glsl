// The hemi-octahedral map: unit vectors of the upper hemisphere (z >= 0) on the square [-1, 1]², without a crease.
//
// Provides: `hemi_octahedral_encode`, `hemi_octahedral_decode`, and the frame in which a VPL's hemisphere is upper.
// Constants: FRAME_TURNS_OVER of renderer/frame/visibility_map_layout.py.
// Twin: the same names in tuner/surrogate/vpl_visibility.py. Source: Cigolle et al. 2014, "hemi-oct".

// The point of the square for a direction of any length, z >= 0.
vec2 hemi_octahedral_encode(vec3 direction) {
    vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + direction.z);
    return vec2(p.x + p.y, p.x - p.y);
}

// The unit vector for a point of the square.
vec3 hemi_octahedral_decode(vec2 encoded) {
    vec2 p = vec2(encoded.x + encoded.y, encoded.x - encoded.y) * 0.5;
    return normalize(vec3(p, 1.0 - abs(p.x) - abs(p.y)));
}

// Columns: two tangents and the unit normal, right-handed (Duff et al. 2017). The tangents jump where the normal's z
// passes FRAME_TURNS_OVER.
mat3 hemisphere_frame(vec3 normal) {
    float s = normal.z >= FRAME_TURNS_OVER ? 1.0 : -1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    return mat3(
        vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x),
        vec3(b, s + normal.y * normal.y * a, -normal.y),
        normal);
}
