// Unit vectors in two channels of [0, 1]: octahedral mapping (Cigolle et al. 2014, section 3).
// With 16 bits a channel the angular error stays below 6e-5 rad.

vec2 octahedral_sign(vec2 v) {
    return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

vec2 octahedral_encode(vec3 direction) {
    vec2 p = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    vec2 folded = direction.z >= 0.0 ? p : (1.0 - abs(p.yx)) * octahedral_sign(p);
    return folded * 0.5 + 0.5;
}

vec3 octahedral_decode(vec2 encoded) {
    vec2 p = encoded * 2.0 - 1.0;
    vec3 direction = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    if (direction.z < 0.0) {
        direction.xy = (1.0 - abs(direction.yx)) * octahedral_sign(direction.xy);
    }
    return normalize(direction);
}
