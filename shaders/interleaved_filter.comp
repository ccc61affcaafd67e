// Reconstruction of interleaved pictures: every pixel takes from its neighbours on the same surface what they
// gathered and left to it (Keller and Heidrich 2001, the discontinuity buffer; Segovia et al. 2006).
//
// The window is n + 1 pixels wide, n = INTERLEAVE, its outer pixels counting half, so that it is centred and
// each of the n² subsets counts once. Pixels on another surface are left out, by plane distance, told in pixel
// footprints so that no length enters, and by normal. Weights are divided by their sum: a constant stays itself.
// Near an edge, part of the subsets is missing; with REFINE, pixels where what is there is too few or too
// uneven to say what is missing go into the list for a full gather.
#include "common/gbuffer.glsl"
#include "common/pixel_list.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D interleaved;
uniform sampler2D base;  // with ADD_BASE: added to the result

layout(rgba32f, binding = 0) writeonly uniform image2D out_irradiance;

const int REACH = INTERLEAVE / 2;
const int TILE = 8 + 2 * REACH;

shared vec4 tile_irradiance[TILE * TILE];  // alpha 0: no surface
shared vec3 tile_position[TILE * TILE];    // from the eye, which keeps float32 precise near it
shared vec3 tile_normal[TILE * TILE];

void load_tile(ivec2 size) {
    ivec2 corner = ivec2(gl_WorkGroupID.xy) * 8 - REACH;
    for (int i = int(gl_LocalInvocationIndex); i < TILE * TILE; i += 64) {
        ivec2 pixel = corner + ivec2(i % TILE, i / TILE);
        ivec2 inside = clamp(pixel, ivec2(0), size - 1);
        Receiver receiver = gbuffer_receiver(inside);
        bool usable = receiver.valid && pixel == inside;
        tile_irradiance[i] = vec4(texelFetch(interleaved, inside, 0).rgb, usable ? 1.0 : 0.0);
        tile_position[i] = receiver.position_world - camera_to_world[3].xyz;
        tile_normal[i] = receiver.normal_world;
    }
    barrier();
}

// Irradiance weighed over the window, the sum of weights (at most n²), and the weighed square of its mean channel.
struct Window {
    vec4 sum;
    float square;
};

Window weigh(int center, float plane_tolerance) {
    Window window = Window(vec4(0.0), 0.0);
    vec3 normal = tile_normal[center];
    float plane = dot(normal, tile_position[center]);
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            int tap = center + y * TILE + x;
            bool same_surface = abs(dot(normal, tile_position[tap]) - plane) < plane_tolerance
                             && dot(normal, tile_normal[tap]) > NORMAL_COSINE;
            float weight = (abs(x) == REACH ? 0.5 : 1.0) * (abs(y) == REACH ? 0.5 : 1.0);
            weight = same_surface ? weight * tile_irradiance[tap].a : 0.0;
            vec3 irradiance = tile_irradiance[tap].rgb;
            float level = (irradiance.r + irradiance.g + irradiance.b) / 3.0;
            window.sum += weight * vec4(irradiance, 1.0);
            window.square += weight * level * level;
        }
    }
    return window;
}

bool needs_full_gather(Window window) {
    float weight = window.sum.a;
    float level = (window.sum.r + window.sum.g + window.sum.b) / (3.0 * weight);
    // Of the mean: what the subsets' spread leaves uncertain, were they drawn at random.
    float variance = (window.square / weight - level * level) / weight;
    return weight < FEWEST_SUBSETS * float(INTERLEAVE * INTERLEAVE)
        || variance > LARGEST_VARIANCE * level * level;
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
    float view_depth = near_plane / texelFetch(gbuffer_depth, pixel, 0).r;
    float pixel_footprint = 2.0 * tan_half_fov.y * view_depth / float(size.y);
    Window window = weigh(center, PLANE_TOLERANCE * pixel_footprint);
    if (REFINE != 0 && needs_full_gather(window)) {
        append_pixel(pixel);
    }
    vec3 irradiance = window.sum.rgb / window.sum.a;
    if (ADD_BASE != 0) {
        irradiance += texelFetch(base, pixel, 0).rgb;
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
}
