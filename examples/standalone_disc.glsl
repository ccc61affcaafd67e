// The light of a cell, for standalone_reader.py: a disc of even radiosity, cut off at the receiver's horizon. The
// program defines least_part, of a disc's area, and least_radius and fade_height, in units of scene_length.

#ifdef LIGHTING
// Of a unit disc, the part past a chord at distance t before its middle: its share of the area; how far its centroid
// is from the middle.
vec2 past_chord(float t) {
    float a = min(abs(t), 1.0), half_chord = sqrt(1.0 - a * a);
    float lesser = (acos(a) - a * half_chord) / 3.14159265358979;
    float share = t > 0.0 ? 1.0 - lesser : lesser;
    return vec2(share, 2.0 / (3.0 * 3.14159265358979) * pow(half_chord, 3.0) / max(share, least_part));
}

// Irradiance of a flux of π on a receiver with normal n; the disc's middle is at d from it, its normal is m. All
// lengths in units of scene_length.
float disc_form(vec3 d, vec3 n, vec3 m, float radius) {
    radius = max(radius, least_radius);
    float height = -dot(m, d), between = dot(n, m), slope = sqrt(max(1.0 - between * between, 1e-12));
    // So near to a disc's plane, a light's map does not tell on which side of it a surface is.
    float fade = clamp(2.0 * height / fade_height - 1.0, 0.0, 1.0);
    vec2 part = past_chord(dot(n, d) / (slope * radius));
    if (fade == 0.0 || part.x < least_part) { return 0.0; }
    // What is over the receiver's horizon shines as a disc of its area at its centroid (Howell, Siegel and Mengüç
    // 2010, of an element parallel and at right angles to it).
    d += (n - between * m) * (part.y * radius / slope);
    float dd = dot(d, d), rr = radius * radius * part.x, excess = dd - rr;
    float q = sqrt(max(excess * excess + 4.0 * height * height * rr, 1e-36)), larger = q + abs(excess);
    float axial = excess > 0.0 ? height * height / larger : larger / (4.0 * rr);
    vec3 vector = (d + height * m) * (height / (q + dd + rr)) - m * axial;
    return max(dot(n, vector), 0.0) * 2.0 * fade * part.x / q;
}
#endif
