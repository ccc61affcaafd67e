// Irradiance from a clustered disc light: a disc of even radiosity, cut off at the receiver's horizon.
//
// Provides: `disc_vector_irradiance`. Needs PI, common/virtual_point_lights.glsl and common/vpl_irradiance.glsl.
// Constants: DISC_LEAST_PART, DISC_LEAST_RADIUS, DISC_FADE_HEIGHT and DISC_FACING_FADE_HEIGHT of
// renderer/frame/vpl_disc_bounds.py.
// Twin: tuner/surrogate/vpl_disc.py. A short version: examples/standalone_disc.glsl.
//
// The disc has centre c, normal m, radius l and flux Φ. A receiver at x, with normal n, is h = m·(x - c) > 0 above its
// plane. With ρ = (x - c) - h m, S = |x - c|² + l² and Q = √(S² - 4ρ²l²), the irradiance is
//     E = 2Φ/(πQ) · [ -m·n h²/(Q + S - 2l²) - ρ·n h/(Q + S) ].
// The two terms are -m·n and -ρ·n/ρ times the form factors from a surface element to a disc parallel to it and to one
// at right angles to it (Howell, Siegel and Mengüç 2010). From afar, E becomes Φ cosθ_x cosθ_m/(πd²).
// This holds while the whole disc is above the receiver's horizon. Otherwise the part above the horizon is taken as a
// disc of its own area around its own centroid. (Baum et al. 1989 clip polygons at the horizon.)
// Close to the disc, that replacement dips below the horizon, and its two sides cancel. There the emitter is nearly a
// half-space, whose form factor is (1 - m·n)/2. So E is at least Φ/(πl²) (1 - m·n)/2 F⁴, F being the form factor of the
// uncut disc for a receiver that faces it. The exponent has the least error against numerical integrals
// (tests/physics/test_vpl_disc.py). Only where the centre is well above the horizon: a disc whose centre is behind a thin
// wall must not shine in front of it.

// A chord cuts a unit disc. `t` is the centre's signed distance from the chord, positive where the centre is on the
// kept side. Returns x, the kept part's share of the area, and y, the distance of its centroid from the centre.
vec2 disc_past_chord(float t) {
    // Kept below 1, where the derivatives of the square roots are infinite. 1e-6 is a choice.
    float a = min(abs(t), 1.0 - 1e-6);
    float root = sqrt(1.0 - a);
    float half_chord = root * sqrt(1.0 + a);
    // arccos a by the polynomial of Abramowitz and Stegun 1964, 4.4.45.
    float angle = root * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)));
    float lesser = max(angle - a * half_chord, 0.0) / PI;
    float share = t > 0.0 ? 1.0 - lesser : lesser;
    float moment = 2.0 / (3.0 * PI) * half_chord * half_chord * half_chord;
    return vec2(share, moment / max(share, DISC_LEAST_PART));
}

// Q, and the axial term h²/(Q + S - 2l²), for a receiver at `height` over the disc's plane.
vec2 disc_axial(float distance_squared, float height, float radius_squared) {
    // Q + S - 2l² = Q + excess. For a negative excess it is computed as 4h²l²/(Q - excess), where no digits cancel.
    // 1e-36, a length in L to the fourth power, keeps Q above 0.
    float excess = distance_squared - radius_squared;
    float q = sqrt(max(excess * excess + 4.0 * height * height * radius_squared, 1e-36));
    float larger = q + abs(excess);
    return vec2(q, excess > 0.0 ? height * height / larger : larger / (4.0 * radius_squared));
}

// Vector irradiance in units of Φ/π: its dot product with the receiver's normal is the irradiance, where positive.
// Lengths are in units of L.
vec3 disc_vector(vec3 to_vpl, vec3 normal, vec3 vpl_normal, float radius) {
    float height = -dot(vpl_normal, to_vpl);
    float between = dot(normal, vpl_normal);
    // Sine of the angle between the two planes. The bound avoids a division by 0 for parallel planes.
    float slope = sqrt(max(1.0 - between * between, 1e-12));
    float above = dot(normal, to_vpl) / (slope * radius);
    vec2 part = disc_past_chord(above);
    float facing = max(-between, 0.0);
    float fade_height = (DISC_FADE_HEIGHT + DISC_FACING_FADE_HEIGHT * facing * facing) * radius;
    float fade = min(2.0 * height / fade_height - 1.0, 1.0);
    if (!(fade > 0.0) || part.x < DISC_LEAST_PART) {
        return vec3(0.0);
    }
    vec3 to_part = to_vpl + (normal - between * vpl_normal) * (part.y * radius / slope);
    float radius_squared = radius * radius * part.x;
    float distance_squared = dot(to_part, to_part);
    vec2 axial = disc_axial(distance_squared, height, radius_squared);
    float lateral = height / (axial.x + distance_squared + radius_squared);
    vec3 vector = ((to_part + height * vpl_normal) * lateral - vpl_normal * axial.y) * (2.0 * part.x / axial.x);
    vec2 uncut = disc_axial(dot(to_vpl, to_vpl), height, radius * radius);
    float facing_form = 2.0 * radius * radius * uncut.y / uncut.x;
    float squared_form = facing_form * facing_form;
    float least = clamp(2.0 * above, 0.0, 1.0) * 0.5 * (1.0 - between) * squared_form * squared_form / (radius * radius);
    return (vector + normal * max(least - dot(normal, vector), 0.0)) * fade;
}

// Vector irradiance [1/world units²] of one watt of the VPL's flux. The counterpart for points is
// `vpl_falloff` in common/vpl_irradiance.glsl.
vec3 disc_vector_irradiance(
    vec3 to_vpl, vec3 normal, VirtualPointLight vpl, float scene_length, FalloffParameters parameters
) {
    vec3 to_vpl_in_l = to_vpl / scene_length;
    float radius = max(parameters.falloff_footprint * vpl.position_footprint.w / scene_length, DISC_LEAST_RADIUS);
    float transmittance = exp(-parameters.extinction_coefficient * length(to_vpl_in_l));
    return disc_vector(to_vpl_in_l, normal, vpl.normal_area.xyz, radius)
         * (parameters.intensity / PI * transmittance / (scene_length * scene_length));
}
