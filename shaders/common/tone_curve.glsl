// The tone curve and the sRGB encoding: from exposed radiance to display values.
//
// Provides: `tone_curve`, `srgb_encode`. Twins: tuner/metrics/tone_curve.py, tuner/report/templates/scene.js.

// Khronos PBR Neutral (2024); all numbers are the specification's. Below `start_compression` it keeps hue and the
// albedo of evenly lit surfaces.
vec3 tone_curve(vec3 color) {
    const float start_compression = 0.8 - 0.04;
    const float desaturation = 0.15;
    float low = min(color.r, min(color.g, color.b));
    color -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < start_compression) {
        return color;
    }
    float room = 1.0 - start_compression;
    float new_peak = 1.0 - room * room / (peak + room - start_compression);
    float towards_white = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(color * new_peak / peak, vec3(new_peak), towards_white);
}

// The sRGB transfer function (IEC 61966-2-1), for [0, 1].
vec3 srgb_encode(vec3 linear) {
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}
