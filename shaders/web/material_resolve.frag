// Web page, material resolve: radiance towards the eye, L = albedo/π · E.
//
// Reads: albedo, direct and indirect irradiance. Writes: radiance. Runtime: display/material_resolve.comp.
uniform sampler2D gbuffer_albedo;
uniform sampler2D direct_irradiance;
uniform sampler2D indirect_irradiance;
uniform float indirect_share;  // number of all VPLs over those gathered so far

layout(location = 0) out vec4 out_radiance;

const float PI = 3.14159265358979;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 albedo = texelFetch(gbuffer_albedo, pixel, 0);
    vec3 irradiance = texelFetch(direct_irradiance, pixel, 0).rgb
                    + indirect_share * texelFetch(indirect_irradiance, pixel, 0).rgb;
    out_radiance = vec4(albedo.rgb / PI * irradiance, albedo.a);
}
