// The octahedral map: unit vectors in two channels of [0, 1]. With 16 bits a channel, the angular error stays below
// 6e-5 rad.
//
// Provides: `octahedral_encode`, `octahedral_decode`. Twin of the latter: renderer/gpu/octahedral.py.
// Source: Cigolle et al. 2014, section 3.

// The sign of each component, 1 for 0.
vec2 octahedral_sign(vec2 v) {
    return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

// Two numbers in [0, 1] for a direction of any length but 0.
vec2 octahedral_encode(vec3 direction) {
    vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    vec2 folded = direction.z >= 0.0 ? p : (1.0 - abs(p.yx)) * octahedral_sign(p);
    return folded * 0.5 + 0.5;
}

// The unit vector for two numbers in [0, 1].
vec3 octahedral_decode(vec2 encoded) {
    vec2 p = encoded * 2.0 - 1.0;
    vec3 direction = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    if (direction.z < 0.0) {
        direction.xy = (1.0 - abs(direction.yx)) * octahedral_sign(direction.xy);
    }
    return normalize(direction);
}
