// Web page, VPL gather: irradiance from some of the VPLs, added to that of earlier ones.
//
// Reads: G-buffer, VPLs, moments, the earlier irradiance, and visibility maps if VISIBILITY_MAP_SIZE > 0.
// Writes: irradiance [W/m²]. With VPL_DISCS, VPLs shine as discs, otherwise as points.
// Runtime: vpl_gather/vpl_gather.comp.
#include "common/gbuffer.glsl"
#include "common/virtual_point_lights.glsl"
#include "web/scene_length.glsl"

const float PI = 3.14159265358979;
#include "common/vpl_irradiance.glsl"
#ifdef VPL_DISCS
#include "common/vpl_disc.glsl"
#endif
#include "web/vpl_texture.glsl"
#if VISIBILITY_MAP_SIZE > 0
#include "web/visibility_atlas.glsl"

uniform float visibility_bias;
uniform float visibility_softness;
#endif

uniform sampler2D earlier;
uniform int first;  // VPLs from first up to, but not including, end
uniform int end;
uniform float intensity;
uniform float falloff_footprint;
uniform float extinction_coefficient;

layout(location = 0) out vec4 out_irradiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver receiver = gbuffer_receiver(pixel);
    out_irradiance = first > 0 ? texelFetch(earlier, pixel, 0) : vec4(0.0);
    if (!receiver.valid) {
        return;
    }
    FalloffParameters parameters = FalloffParameters(intensity, falloff_footprint, extinction_coefficient);
    float scene_length = measured_scene_length();
    vec3 irradiance = vec3(0.0);
    for (int i = first; i < end; ++i) {
        VirtualPointLight vpl = vpl_at(i);
#ifdef VPL_DISCS
        vec3 to_vpl = vpl.position_footprint.xyz - receiver.position_world;
        vec3 arriving = disc_vector_irradiance(to_vpl, receiver.normal_world, vpl, scene_length, parameters);
        vec3 unoccluded = vpl.flux.rgb * max(dot(receiver.normal_world, arriving), 0.0);
#else
        vec3 unoccluded = vpl_irradiance(
            receiver.position_world, receiver.normal_world, vpl, scene_length, parameters);
#endif
#if VISIBILITY_MAP_SIZE > 0
        if (any(greaterThan(unoccluded, vec3(0.0)))) {
            unoccluded *= vpl_visibility(
                receiver.position_world, receiver.normal_world, vpl,
                i * (VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE), scene_length,
                VisibilityParameters(visibility_bias, visibility_softness));
        }
#endif
        irradiance += unoccluded;
    }
    out_irradiance.rgb += irradiance;
}
