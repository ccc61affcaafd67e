// A cell of light as a disc of even radiosity, cut off at the receiver's horizon. Twin: tuner/surrogate/vpl_disc.py.
//
// Of a disc around c with normal m, radius l and flux Φ, a receiver at x with normal n gets, with the height
// h = m·(x - c) > 0, ρ = (x - c) - h m, S = |x - c|² + l² and Q = √(S² - 4ρ²l²),
//     E = 2Φ/(πQ) · [ -m·n h²/(Q + S - 2l²) - ρ·n h/(Q + S) ],
// which is -m·n and -ρ·n/ρ times the form factors of an element parallel and at right angles to a disc (Howell, Siegel
// and Mengüç 2010), and Φ cosθ_x cosθ_m/(πd²) from afar. It holds while all of the disc is over the receiver's
// horizon. Else the part that is (Baum et al. 1989 clip polygons so) shines as a disc of its area at its centroid.

// Of a unit disc, the part on the far side of a chord that passes its middle at distance t on the near side:
// x, its share of the area; y, how far its centroid is from the middle.
vec2 disc_past_chord(float t) {
    // Less than 1, where the roots' derivatives are not finite.
    float a = min(abs(t), 1.0 - 1e-6);
    float root = sqrt(1.0 - a);
    float half_chord = root * sqrt(1.0 + a);
    // arccos a (Abramowitz and Stegun 1964, 4.4.45).
    float angle = root * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)));
    float lesser = max(angle - a * half_chord, 0.0) / PI;
    float share = t > 0.0 ? 1.0 - lesser : lesser;
    float moment = 2.0 / (3.0 * PI) * half_chord * half_chord * half_chord;
    return vec2(share, moment / max(share, DISC_LEAST_PART));
}

// Vector irradiance, in units of Φ/π: times the receiver's normal, irradiance where that is positive. Lengths are
// in units of L.
vec3 disc_vector(vec3 to_vpl, vec3 normal, vec3 vpl_normal, float radius) {
    float height = -dot(vpl_normal, to_vpl);
    float between = dot(normal, vpl_normal);
    // Sine of the angle between both planes; its bound keeps parallel ones from dividing by 0.
    float slope = sqrt(max(1.0 - between * between, 1e-12));
    vec2 part = disc_past_chord(dot(normal, to_vpl) / (slope * radius));
    float fade = min(2.0 * height / DISC_FADE_HEIGHT - 1.0, 1.0);
    if (!(fade > 0.0) || part.x < DISC_LEAST_PART) {
        return vec3(0.0);
    }
    vec3 to_part = to_vpl + (normal - between * vpl_normal) * (part.y * radius / slope);
    float radius_squared = radius * radius * part.x;
    float distance_squared = dot(to_part, to_part);
    // Q + S - 2l² is Q + excess. Where the excess is negative, it is 4h²l²/(Q - excess), which does not cancel.
    float excess = distance_squared - radius_squared;
    float q = sqrt(max(excess * excess + 4.0 * height * height * radius_squared, 1e-36));
    float larger = q + abs(excess);
    float axial = excess > 0.0 ? height * height / larger : larger / (4.0 * radius_squared);
    float lateral = height / (q + distance_squared + radius_squared);
    return ((to_part + height * vpl_normal) * lateral - vpl_normal * axial) * (2.0 * fade * part.x / q);
}

// As `disc_vector`, of one watt of the VPL's flux. `vpl_falloff` is its counterpart for points.
vec3 disc_vector_irradiance(
    vec3 to_vpl, vec3 normal, VirtualPointLight vpl, float scene_length, FalloffParameters parameters
) {
    vec3 to_vpl_in_l = to_vpl / scene_length;
    float radius = max(parameters.falloff_footprint * vpl.position_footprint.w / scene_length, DISC_LEAST_RADIUS);
    float transmittance = exp(-parameters.extinction_coefficient * length(to_vpl_in_l));
    return disc_vector(to_vpl_in_l, normal, vpl.normal_area.xyz, radius)
         * (parameters.intensity / PI * transmittance / (scene_length * scene_length));
}
