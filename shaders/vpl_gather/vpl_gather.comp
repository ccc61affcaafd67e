// VPL gather: irradiance at every pixel, from every VPL of some ranges or from the pixel's subset of them. VPLs pass
// through shared memory in batches of 64.
//
// Reads: G-buffer, VPLs, scene length, artist parameters; visibility maps if VISIBILITY_MAP_SIZE > 0; with
// LISTED_PIXELS, the pixel list; with GLOWING, the irradiance that this is added to. Writes: irradiance [W/m²]; with
// INTERLEAVE > 1, the direction that the light comes from.
// Constants: VPL_RANGES (how many), VPL_DISCS (VPLs are clustered disc lights, else points), GLOWING (they lie on surfaces
// that glow, whose light no artist parameter changes), LISTED_PIXELS (only pixels of the list, for a full gather),
// INTERLEAVE. Python: renderer/frame/passes/vpl_gather.py. Twin: tuner/surrogate/vpl_gather.py.
//
// Interleaved sampling (Keller and Heidrich 2001): the pixels of an n×n block, n = INTERLEAVE, divide the VPLs among
// themselves, each VPL n² times as bright. A workgroup takes pixels at one position of their blocks, so all its pixels
// read the same VPLs (Segovia et al. 2006; here by arithmetic on the pixel index). The direction lets the filter
// convert a pixel's irradiance to its neighbours' normals.
#include "common/artist_parameters.glsl"
#include "common/gbuffer.glsl"
#include "common/scene_length.glsl"
#include "common/virtual_point_lights.glsl"

const float PI = 3.14159265358979;
#include "common/vpl_irradiance.glsl"
#if VPL_DISCS
#include "common/vpl_disc.glsl"
#endif
#include "common/pixel_list.glsl"
#if VISIBILITY_MAP_SIZE > 0
#include "common/vpl_visibility.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;
#if INTERLEAVE > 1
layout(rg16, binding = DIRECTION_IMAGE) writeonly uniform image2D out_direction;  // octahedral
#endif

uniform ivec2 vpl_ranges[VPL_RANGES];  // first VPL and number of each

#if GLOWING
uniform sampler2D added_irradiance;
#endif

const int SUBSETS = INTERLEAVE * INTERLEAVE;

shared VirtualPointLight batch[64];

// The pixel of this invocation, or (-1, -1) for none.
ivec2 own_pixel(int subset) {
    if (LISTED_PIXELS != 0) {
        return listed_pixel(gl_WorkGroupID.xy, gl_LocalInvocationIndex);
    }
    ivec2 place = ivec2(subset % INTERLEAVE, subset / INTERLEAVE);
    return ivec2(gl_GlobalInvocationID.xy) * INTERLEAVE + place;
}

void main() {
    int subset = int(gl_WorkGroupID.z);
    ivec2 pixel = own_pixel(subset);
    ivec2 size = imageSize(out_irradiance);
#if GLOWING
    FalloffParameters parameters = FalloffParameters(float(SUBSETS), 1.0, 0.0);
#else
    FalloffParameters parameters = FalloffParameters(
        artist.intensity * float(SUBSETS), artist.falloff_footprint, artist.extinction_coefficient);
#endif
#if VISIBILITY_MAP_SIZE > 0
    VisibilityParameters visibility = VisibilityParameters(artist.visibility_bias, artist.visibility_softness);
#endif
    Receiver receiver = gbuffer_receiver(clamp(pixel, ivec2(0), size - 1));
    vec3 irradiance = vec3(0.0);
    vec3 vector_irradiance = vec3(0.0);  // sum of channels; its dot product with a normal is the irradiance on it
    for (int range = 0; range < VPL_RANGES; ++range) {
        // Any run of the R2 sequence is evenly spread, so each subset is a good set of VPLs.
        int first = vpl_ranges[range].x + subset * vpl_ranges[range].y / SUBSETS;
        int end = vpl_ranges[range].x + (subset + 1) * vpl_ranges[range].y / SUBSETS;
        for (int start = first; start < end; start += 64) {
            int lane = int(gl_LocalInvocationIndex);
            if (start + lane < end) {
                batch[lane] = virtual_point_lights[start + lane];
            }
            barrier();
            int count = min(64, end - start);
            for (int i = 0; i < count; ++i) {
                VirtualPointLight vpl = batch[i];
                vec3 to_vpl = vpl.position_footprint.xyz - receiver.position_world;
#if VPL_DISCS
                vec3 arriving = disc_vector_irradiance(to_vpl, receiver.normal_world, vpl, scene_length, parameters);
#else
                vec3 arriving = to_vpl * vpl_falloff(to_vpl, vpl, scene_length, parameters);
#endif
                float received = dot(receiver.normal_world, arriving);
                // About half of all pairs face away from each other: they need no lookup in the map.
                if (!(received > 0.0)) {
                    continue;
                }
#if VISIBILITY_MAP_SIZE > 0
                float seen = vpl_visibility(
                    receiver.position_world, receiver.normal_world, vpl,
                    (start + i) * (VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE), scene_length, visibility);
                received *= seen;
                arriving *= seen;
#endif
                irradiance += vpl.flux.rgb * received;
#if INTERLEAVE > 1
                vector_irradiance += arriving * dot(vpl.flux.rgb, vec3(1.0));
#endif
            }
            barrier();
        }
    }
    if (pixel.x >= 0 && all(lessThan(pixel, size))) {
#if GLOWING
        irradiance += texelFetch(added_irradiance, pixel, 0).rgb;
#endif
        imageStore(out_irradiance, pixel, receiver.valid ? vec4(irradiance, 1.0) : vec4(0.0));
#if INTERLEAVE > 1
        bool lit = any(notEqual(vector_irradiance, vec3(0.0)));
        vec2 direction = octahedral_encode(lit ? vector_irradiance : receiver.normal_world);
        imageStore(out_direction, pixel, vec4(direction, 0.0, 0.0));
#endif
    }
}
