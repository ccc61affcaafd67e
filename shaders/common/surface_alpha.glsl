// Where a surface has holes, and how much light it stops.
//
// Provides: `surface_opacity`, `is_seen`, `is_blended`, `stops_light_of_texel`. Needs common/surface.glsl.
// Reads: the outputs of geometry.vert or reflective_shadow_map.vert with HAS_ALPHA, and the base colour texture.

#include "common/hash.glsl"

flat in vec4 alpha;  // opacity, cutoff, 1 if blended, number of the instance

// Opacity under the centre of the pixel, in [0, 1]. From the texture itself, not from a smaller level: there, leaves
// and gaps would be mixed, and whole trees fall below the cutoff.
float surface_opacity() {
    return alpha.x * textureLod(base_color_texture, texture_place(), 0.0).a;
}

// Whether the camera sees it. A blended surface is seen where it stops at least half of the light.
bool is_seen() {
    return surface_opacity() >= alpha.y;
}

bool is_blended() {
    return alpha.z > 0.0;
}

// Whether the surface stops the light of one texel of the RSM: a blended one does with its opacity as the probability.
// The number depends on the texel and the triangle alone, so it stays from frame to frame, and surfaces one behind
// another are independent.
bool stops_light_of_texel(ivec2 texel) {
    if (!is_blended()) {
        return is_seen();
    }
    uint surface = hashed(uint(gl_PrimitiveID) ^ hashed(uint(alpha.w)));
    return unit_number(hashed(uint(texel.x) ^ hashed(uint(texel.y) ^ surface))) < surface_opacity();
}
