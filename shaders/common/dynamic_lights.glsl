// Dynamic lights: many small point and spot lights, direct light only, without shadows.
//
// Provides: `dynamic_lights` and `dynamic_light_irradiance`.
// Constants: MIN_DISTANCE [ranges] of renderer/scene/dynamic_lights.py; nearer than this a light grows no brighter.
// Python: renderer/scene/dynamic_lights.py (layout and meaning), renderer/frame/light_pre_pass.py (upload).
// Source: KHR_lights_punctual, "Range Property" and "Inner and Outer Cone Angles".

struct DynamicLight {
    vec4 position_range;        // world position; range [world units]
    vec4 intensity_cos_outer;   // W/sr; cosine of the outer half angle, below -1 for a point light
    vec4 direction_cone_scale;  // unit direction of travel; 1 / (cos inner - cos outer)
};

layout(std430, binding = DYNAMIC_LIGHTS_BINDING) readonly buffer DynamicLights {
    DynamicLight dynamic_lights[];
};

// Irradiance [W/m²] of one light: I · cosθ · cone · (1 - (d/range)⁴) / d².
vec3 dynamic_light_irradiance(DynamicLight light, vec3 position_world, vec3 normal_world) {
    vec3 to_light = light.position_range.xyz - position_world;
    float range = light.position_range.w;
    float ratio = dot(to_light, to_light) / (range * range);  // (d/range)²
    if (ratio >= 1.0) {
        return vec3(0.0);
    }
    float bounded = max(ratio, MIN_DISTANCE * MIN_DISTANCE);
    float window = 1.0 - bounded * bounded;
    vec3 towards = to_light * inversesqrt(max(dot(to_light, to_light), 1e-30));
    float ramp = clamp(
        (dot(-towards, light.direction_cone_scale.xyz) - light.intensity_cos_outer.w) * light.direction_cone_scale.w,
        0.0, 1.0);
    float cosine = max(dot(normal_world, towards), 0.0);
    return light.intensity_cos_outer.rgb * (cosine * ramp * ramp * window / (bounded * range * range));
}
