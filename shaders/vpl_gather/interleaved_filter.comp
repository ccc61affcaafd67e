// Interleaved filter: reconstructs an image from interleaved pixels. Each pixel averages what its neighbours on the
// same surface gathered from their subsets of the VPLs.
//
// Reads: G-buffer, the interleaved image; with RELIGHT, the direction of its light; with ADD_BASE, an image to add.
// Writes: irradiance; with REFINE, the list of pixels that need a full gather.
// Constants: INTERLEAVE, RELIGHT, REFINE, LEAST_SHARE, ADD_BASE; PLANE_TOLERANCE [pixel footprints], NORMAL_COSINE, LEAST_COSINE,
// LARGEST_RELIGHTING, LEAST_VARIANCE, LEAST_ABSENT and LARGEST_ERROR of renderer/frame/irradiance_filter.py.
// Python: renderer/frame/irradiance_filter.py.
// Source: Keller and Heidrich 2001 (the discontinuity buffer); Segovia et al. 2006.
//
// The window is n + 1 pixels wide, n = INTERLEAVE. Its outer pixels count half, so it is centred and each of the n²
// subsets counts once. Pixels on another surface are left out, by normal and by distance from the pixel's plane, in
// pixel footprints so that no world unit enters. Weights are divided by their sum: a constant image stays constant.
// With RELIGHT, a neighbour's irradiance is first converted to the pixel's normal, by the direction of its light.
// Near an edge, some subsets are missing. With REFINE, pixels whose remaining subsets are too few or too uneven go into
// the list for a full gather; so do those of which fewer than LEAST_SHARE of the subsets remain.
#include "common/gbuffer.glsl"
#include "common/pixel_list.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D interleaved;
uniform sampler2D direction;  // with RELIGHT: of the light, octahedral
uniform sampler2D base;       // with ADD_BASE: added to the result

layout(rgba32f, binding = IRRADIANCE_IMAGE) writeonly uniform image2D out_irradiance;

const int REACH = INTERLEAVE / 2;  // of the window, in pixels
const int TILE = 8 + 2 * REACH;    // a workgroup's 8×8 pixels and the window's border

shared vec4 tile_irradiance[TILE * TILE];  // alpha: distance along the view axis, 0 without a surface
shared vec3 tile_normal[TILE * TILE];
shared vec3 tile_light[TILE * TILE];  // dot(this, n): irradiance on normal n over that on the pixel's own normal

// Load a workgroup's pixels and border into shared memory.
void load_tile(ivec2 size) {
    ivec2 corner = ivec2(gl_WorkGroupID.xy) * 8 - REACH;
    for (int i = int(gl_LocalInvocationIndex); i < TILE * TILE; i += 64) {
        ivec2 pixel = corner + ivec2(i % TILE, i / TILE);
        ivec2 inside = clamp(pixel, ivec2(0), size - 1);
        Receiver receiver = gbuffer_receiver(inside);
        bool usable = receiver.valid && pixel == inside;
        float depth = usable ? near_plane / texelFetch(gbuffer_depth, inside, 0).r : 0.0;
        tile_irradiance[i] = vec4(texelFetch(interleaved, inside, 0).rgb, depth);
        tile_normal[i] = receiver.normal_world;
        if (RELIGHT != 0) {
            vec3 light = octahedral_decode(texelFetch(direction, inside, 0).rg);
            tile_light[i] = light / max(dot(light, receiver.normal_world), LEAST_COSINE);
        }
    }
    barrier();
}

struct Window {
    vec4 sum;     // neighbours on the pixel's surface: weighted sum of irradiance; sum of weights, at most n²
    vec3 around;  // neighbours on any surface: weighted sums of the mean channel squared and of it; sum of weights
};

// The window around a pixel; `center` is the pixel's index in the tile.
Window weigh(int center, vec2 ndc, vec2 ndc_step) {
    Window window = Window(vec4(0.0), vec3(0.0));
    vec3 normal = tile_normal[center];
    float depth = tile_irradiance[center].a;
    // The height of a neighbour over the pixel's plane is its depth times a linear function of its position in the
    // image, minus the same for the pixel.
    vec3 normal_camera = normal * mat3(camera_to_world);
    float slope = dot(normal_camera, vec3(ndc * tan_half_fov, -1.0));
    vec2 slope_step = normal_camera.xy * tan_half_fov * ndc_step;
    float plane_tolerance = PLANE_TOLERANCE * tan_half_fov.y * ndc_step.y * depth;
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            int tap = center + y * TILE + x;
            vec4 neighbour = tile_irradiance[tap];
            vec3 irradiance = neighbour.rgb;
            if (RELIGHT != 0) {
                irradiance *= clamp(dot(normal, tile_light[tap]), 0.0, LARGEST_RELIGHTING);
            }
            float height = neighbour.a * (slope + dot(slope_step, vec2(x, y))) - depth * slope;
            float same_surface = step(abs(height), plane_tolerance)
                               * step(NORMAL_COSINE, dot(normal, tile_normal[tap]));
            float weight = (abs(x) == REACH ? 0.5 : 1.0) * (abs(y) == REACH ? 0.5 : 1.0);
            weight = neighbour.a > 0.0 ? weight : 0.0;
            float level = dot(irradiance, vec3(1.0 / 3.0));
            window.sum += weight * same_surface * vec4(irradiance, 1.0);
            window.around += weight * vec3(level * level, level, 1.0);
        }
    }
    return window;
}

// Whether the subsets that are absent from the window may change its mean too much. The mean of n of N values has the
// variance σ²/n · (1 - n/N) (Cochran 1977, theorem 2.2). σ² is estimated from neighbours on any surface, because the
// absent subset may be the one with a close VPL.
bool needs_full_gather(Window window) {
    float count = window.sum.a;
    float level = dot(window.sum.rgb, vec3(1.0 / 3.0)) / count;
    vec3 around = window.around / window.around.z;
    float variance = around.x - 2.0 * level * around.y + level * level;
    float absent = 1.0 - count / float(INTERLEAVE * INTERLEAVE);
    float error = (variance + LEAST_VARIANCE * level * level) / count * (absent + LEAST_ABSENT);
    return error > LARGEST_ERROR * level * level;
}

void main() {
    ivec2 size = imageSize(out_irradiance);
    load_tile(size);
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    int center = (int(gl_LocalInvocationID.y) + REACH) * TILE + int(gl_LocalInvocationID.x) + REACH;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    if (tile_irradiance[center].a == 0.0) {
        imageStore(out_irradiance, pixel, vec4(0.0));
        return;
    }
    vec2 ndc_step = 2.0 / vec2(size);
    Window window = weigh(center, (vec2(pixel) + 0.5) * ndc_step - 1.0, ndc_step);
    bool alone = window.sum.a < LEAST_SHARE * float(INTERLEAVE * INTERLEAVE);
    if (alone || (REFINE != 0 && needs_full_gather(window))) {
        append_pixel(pixel);
    }
    // What pixels of a coloured sky add up to may be a little below 0.
    vec3 irradiance = max(window.sum.rgb, vec3(0.0)) / window.sum.a;
    if (ADD_BASE != 0) {
        irradiance += texelFetch(base, pixel, 0).rgb;
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
}
