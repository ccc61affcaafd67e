// Web page: rounds octahedral normals to 16 bits a channel, as the runtime's textures store them. The frame of a
// visibility map depends on the sign of the VPL normal's z, which for a wall along an axis is the sign of the rounding.
//
// Provides: `rounded_normal`.
vec2 rounded_normal(vec2 encoded) {
    return floor(encoded * 65535.0 + 0.5) / 65535.0;
}
