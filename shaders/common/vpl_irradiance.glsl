// Irradiance from one VPL that shines as a point.
//
// Provides: `FalloffParameters`, `vpl_falloff`, `vpl_irradiance`. Needs PI and common/virtual_point_lights.glsl.
// Twin: `vpl_irradiance` in tuner/surrogate/vpl_gather.py.
// Source: Keller 1997 (instant radiosity), with the point spread over its footprint l: 1/d² becomes 1/(d² + (αl)²). For
// α = 1 this is the exact form factor of a coaxial disc. The transmittance is exp(-κ d/L).

struct FalloffParameters {
    float intensity;               // k
    float falloff_footprint;       // α [footprints]
    float extinction_coefficient;  // κ [1/L]
};

// The part of the irradiance of one watt that does not depend on the receiver's normal n: multiply by n·to_vpl, where
// positive.
float vpl_falloff(vec3 to_vpl, VirtualPointLight vpl, float scene_length, FalloffParameters parameters) {
    // 1e-30 keeps the quotient finite where receiver and VPL coincide. Both cosines are 0 there.
    float distance_squared = max(dot(to_vpl, to_vpl), 1e-30);
    float cosine_vpl = max(-dot(vpl.normal_area.xyz, to_vpl), 0.0);
    float footprint = parameters.falloff_footprint * vpl.position_footprint.w;
    float form = cosine_vpl / distance_squared / (distance_squared + footprint * footprint);
    float transmittance = exp(-parameters.extinction_coefficient * sqrt(distance_squared) / scene_length);
    return parameters.intensity / PI * form * transmittance;
}

// Irradiance [W/m²] of one VPL on a receiver, without visibility.
vec3 vpl_irradiance(
    vec3 position_world, vec3 normal_world, VirtualPointLight vpl, float scene_length, FalloffParameters parameters
) {
    vec3 to_vpl = vpl.position_footprint.xyz - position_world;
    float cosine_receiver = max(dot(normal_world, to_vpl), 0.0);
    return vpl.flux.rgb * (cosine_receiver * vpl_falloff(to_vpl, vpl, scene_length, parameters));
}
