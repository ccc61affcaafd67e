// Irradiance from a clustered disc light, for standalone_reader.py: a disc of even radiosity, cut off at the receiver's
// horizon. The program defines least_part (a share of the disc's area), least_radius in units of scene_length,
// fade_height and facing_fade_height in radii. The derivation is in shaders/common/vpl_disc.glsl.

#ifdef LIGHTING
// A chord cuts a unit disc at distance t from the centre, t > 0 if the centre is on the kept side. Returns the kept
// part's share of the area, and the distance of its centroid from the centre.
vec2 past_chord(float t) {
    float a = min(abs(t), 1.0), half_chord = sqrt(1.0 - a * a);
    float lesser = (acos(a) - a * half_chord) / 3.14159265358979;
    float share = t > 0.0 ? 1.0 - lesser : lesser;
    return vec2(share, 2.0 / (3.0 * 3.14159265358979) * pow(half_chord, 3.0) / max(share, least_part));
}

// Q and the axial term of the form factors to a disc.
vec2 disc_axial(float dd, float height, float rr) {
    float excess = dd - rr, q = sqrt(max(excess * excess + 4.0 * height * height * rr, 1e-36)), larger = q + abs(excess);
    return vec2(q, excess > 0.0 ? height * height / larger : larger / (4.0 * rr));
}

// Irradiance of a flux of π on a receiver with normal n. The disc has normal m; d is the vector from the receiver to
// its centre. All lengths are in units of scene_length.
float disc_form(vec3 d, vec3 n, vec3 m, float radius) {
    radius = max(radius, least_radius);
    float height = -dot(m, d), between = dot(n, m), slope = sqrt(max(1.0 - between * between, 1e-12));
    // So close to the disc's plane, the depth in the light's map does not tell on which side of it the receiver is.
    // A receiver that faces the disc fades higher up: the surface that the disc stands for may not be flat.
    float facing = max(-between, 0.0), fade_from = (fade_height + facing_fade_height * facing * facing) * radius;
    float fade = clamp(2.0 * height / fade_from - 1.0, 0.0, 1.0);
    vec2 part = past_chord(dot(n, d) / (slope * radius));
    if (fade == 0.0 || part.x < least_part) { return 0.0; }
    // The part above the receiver's horizon is taken as a disc of its own area around its own centroid (Howell, Siegel
    // and Mengüç 2010, form factors to a disc parallel and at right angles to the element).
    vec3 middle = d + (n - between * m) * (part.y * radius / slope);
    float dd = dot(middle, middle), rr = radius * radius * part.x;
    vec2 axial = disc_axial(dd, height, rr), uncut = disc_axial(dot(d, d), height, radius * radius);
    vec3 vector = (middle + height * m) * (height / (axial.x + dd + rr)) - m * axial.y;
    // Close to the disc, it is nearly a half-space.
    float facing_form = 2.0 * radius * radius * uncut.y / uncut.x;
    float above = clamp(2.0 * dot(n, d) / (slope * radius), 0.0, 1.0);
    float least = above * 0.5 * (1.0 - between) * pow(facing_form, 4.0) / (radius * radius);
    return max(dot(n, vector) * 2.0 * part.x / axial.x, least) * fade;
}
#endif
