// Octahedral normals in the steps of the runtime's 16-bit targets: the tangents of a VPL's visibility map turn with
// the sign of its normal's z, which for a wall along an axis is the sign of the rounding.
vec2 rounded_normal(vec2 encoded) {
    return floor(encoded * 65535.0 + 0.5) / 65535.0;
}
