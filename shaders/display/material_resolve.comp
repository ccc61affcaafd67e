// Material resolve: radiance towards the eye, L = albedo/π · E + emission, for diffuse surfaces.
//
// Reads: albedo, direct and indirect irradiance; with GLOWS, emission, and with SHOWS_SKY, the environment: both count as
// direct light. Writes: radiance [W/(m² sr)], alpha 1 where a surface is.
// Python: renderer/frame/passes/material_resolve.py. Twin: tuner/metrics/radiance.py.
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D gbuffer_albedo;
uniform sampler2D direct_irradiance;
uniform sampler2D indirect_irradiance;
#ifdef GLOWS
uniform sampler2D gbuffer_emission;
#endif
#ifdef SHOWS_SKY
uniform sampler2D environment_map;  // equirectangular, row 0 up (renderer/scene/environment.py)
uniform mat4 camera_to_world;
uniform vec2 tan_half_fov;
#endif
uniform vec2 share;  // of direct and of indirect light in the image

layout(rgba32f, binding = RADIANCE_IMAGE) writeonly uniform image2D out_radiance;

const float PI = 3.14159265358979;

#ifdef SHOWS_SKY
// Radiance of the environment [W/(m² sr)] behind a pixel.
vec3 sky_radiance(ivec2 pixel) {
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(imageSize(out_radiance)) * 2.0 - 1.0;
    vec3 direction = normalize(mat3(camera_to_world) * vec3(ndc * tan_half_fov, -1.0));
    vec2 place = vec2(atan(direction.x, -direction.z) / (2.0 * PI), acos(clamp(direction.y, -1.0, 1.0)) / PI);
    ivec2 size = textureSize(environment_map, 0);
    return texelFetch(environment_map, clamp(ivec2(fract(place) * vec2(size)), ivec2(0), size - 1), 0).rgb;
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_radiance)))) {
        return;
    }
    vec4 albedo = texelFetch(gbuffer_albedo, pixel, 0);
    vec3 irradiance = share.x * texelFetch(direct_irradiance, pixel, 0).rgb
                    + share.y * texelFetch(indirect_irradiance, pixel, 0).rgb;
    vec3 radiance = albedo.rgb / PI * irradiance;
#ifdef GLOWS
    radiance += share.x * texelFetch(gbuffer_emission, pixel, 0).rgb;
#endif
#ifdef SHOWS_SKY
    if (!(albedo.a > 0.0)) {
        radiance = share.x * sky_radiance(pixel);
    }
#endif
    imageStore(out_radiance, pixel, vec4(radiance, albedo.a));
}
