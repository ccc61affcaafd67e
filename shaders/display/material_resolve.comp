// Material resolve: radiance towards the eye, L = albedo/π · E, for diffuse surfaces.
//
// Reads: albedo, direct and indirect irradiance. Writes: radiance [W/(m² sr)], alpha 1 where a surface is.
// Python: renderer/frame/passes/material_resolve.py. Twin: tuner/metrics/radiance.py.
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D gbuffer_albedo;
uniform sampler2D direct_irradiance;
uniform sampler2D indirect_irradiance;
uniform vec2 share;  // of direct and of indirect light in the image

layout(rgba32f, binding = RADIANCE_IMAGE) writeonly uniform image2D out_radiance;

const float PI = 3.14159265358979;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_radiance)))) {
        return;
    }
    vec4 albedo = texelFetch(gbuffer_albedo, pixel, 0);
    vec3 irradiance = share.x * texelFetch(direct_irradiance, pixel, 0).rgb
                    + share.y * texelFetch(indirect_irradiance, pixel, 0).rgb;
    imageStore(out_radiance, pixel, vec4(albedo.rgb / PI * irradiance, albedo.a));
}
