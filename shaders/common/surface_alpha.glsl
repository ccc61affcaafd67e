// Where a surface has holes.
//
// Provides: `surface_opacity`. Needs common/surface.glsl.
// Reads: the outputs of geometry.vert or reflective_shadow_map.vert with HAS_ALPHA, and the base colour texture.

flat in vec4 alpha;  // opacity, cutoff; the rest is unused

// Opacity under the centre of the pixel, in [0, 1]. From the texture itself, not from a smaller level: there, leaves
// and gaps would be mixed, and whole trees fall below the cutoff.
float surface_opacity() {
    return alpha.x * textureLod(base_color_texture, texture_place(), 0.0).a;
}
