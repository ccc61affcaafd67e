// Screen-space indirect, part 2: the near field, light that softened VPLs withhold close to a surface, gathered from
// directly lit pixels nearby.
//
// Reads: G-buffer, emitters, mean VPL footprint, frame statistics, artist parameters. Writes: irradiance, interleaved.
// Constants: BLOCK, SAMPLES and NEAREST_PIXEL of renderer/frame/passes/screen_space_indirect.py; R2_STEP_* of
// renderer/frame/point_table.py.
// Python: renderer/frame/passes/screen_space_indirect.py.
//
// A VPL's 1/d² is softened to 1/(d² + (αl)²). In the mean over draws, the VPLs integrate the softened kernel over the
// lit surfaces. What is missing is the same integral with the kernel
//     1/d² - 1/(d² + (αl)²) = 1/d² · (1 - d²/(d² + (αl)²)),
// and with the same intensity k and transmittance T(d). It falls as 1/d⁴, so the visible neighbourhood holds nearly all
// of it. Nichols and Wyman (2010) and Novák et al. (2011) restore the light of bounded VPLs in the same way.
//
// Samples are even in angle and in the logarithm of the radius, because the integrand falls as 1/r² in a corner. The
// pixels of a BLOCK² block take consecutive runs of one R2 sequence; the interleaved filter joins them.
#include "common/artist_parameters.glsl"
#include "common/gbuffer.glsl"
#include "common/pixel_area.glsl"
#include "common/scene_length.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D emitters;

layout(std430, binding = VPL_FOOTPRINT_BINDING) readonly buffer VplFootprint {
    float mean_vpl_footprint;
};

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;

const float PI = 3.14159265358979;
const vec2 R2_STEP = vec2(R2_STEP_X, R2_STEP_Y);

// Irradiance from the surface in pixel `at`.
vec3 near_field(Receiver receiver, ivec2 at) {
    vec4 emitter = texelFetch(emitters, at, 0);
    Receiver surface = gbuffer_receiver(at);
    if (!surface.valid || !(emitter.a > 0.0)) {
        return vec3(0.0);
    }
    vec3 to_emitter = surface.position_world - receiver.position_world;
    float distance_squared = max(dot(to_emitter, to_emitter), 1e-30);
    float cosine_receiver = max(dot(receiver.normal_world, to_emitter), 0.0);
    float cosine_emitter = max(-dot(surface.normal_world, to_emitter), 0.0);

    float area = pixel_area(surface, textureSize(emitters, 0));
    float softening = artist.falloff_footprint * artist.falloff_footprint * emitter.a;
    float lost = softening / (distance_squared + softening);
    // The pixel counts as a disc of its own area: so no neighbour gives more than the form factor of a disc.
    float form = cosine_receiver * cosine_emitter / distance_squared / (distance_squared + area / PI);
    float transmittance = exp(-artist.extinction_coefficient * sqrt(distance_squared) / scene_length);
    return emitter.rgb * (area / PI * form * lost * transmittance);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(out_irradiance);
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    Receiver receiver = gbuffer_receiver(pixel);
    if (!receiver.valid) {
        imageStore(out_irradiance, pixel, vec4(0.0));
        return;
    }
    float view_depth = near_plane / texelFetch(gbuffer_depth, pixel, 0).r;
    float pixel_footprint = 2.0 * tan_half_fov.y * view_depth / float(size.y);
    // At most the height of the image: little beyond that is visible.
    float radius = min(artist.screen_space_radius * mean_vpl_footprint / pixel_footprint, float(size.y));
    vec3 irradiance = vec3(0.0);
    if (radius > NEAREST_PIXEL) {
        float stretch = log(radius / NEAREST_PIXEL);
        ivec2 place = pixel % BLOCK;
        int first = (place.y * BLOCK + place.x) * SAMPLES;
        for (int i = 0; i < SAMPLES; ++i) {
            vec2 point = fract(0.5 + float(first + i) * R2_STEP);
            float reach = NEAREST_PIXEL * exp(stretch * point.y);
            float angle = 2.0 * PI * point.x;
            ivec2 at = ivec2(floor(vec2(pixel) + 0.5 + reach * vec2(cos(angle), sin(angle))));
            if (all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size))) {
                irradiance += near_field(receiver, at) * (reach * reach);
            }
        }
        irradiance *= artist.intensity * artist.screen_space_strength * 2.0 * PI * stretch / float(SAMPLES);
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
}
