// Silhouettes in a visibility map. One runs through a texel if the surface that its ray hit shades the surface that a
// neighbour's ray hit, or the other way round. There, one ray says too little. The corner of a room, or the edge of a
// box that faces the VPL, hides nothing and is no silhouette.
//
// Provides: `is_silhouette`. The including file defines SILHOUETTE_ENTRY(texel), which reads a map's entry.
#include "common/vpl_visibility.glsl"

// A choice: the overlap beyond which one surface hides another, as a share of the distance. It is four times the
// default of visibility_bias.
const float LEAST_OVERLAP = 2e-3;

// Whether the surface `nearer` shades the surface `farther`. Rays that hit something end within `farthest` [L]. A ray
// that hit nothing ends beyond it and is never hidden, because no receiver is there.
bool hides(MetSurface nearer, MetSurface farther, float farthest) {
    return length(farther.end) < farthest && surface_overlap(nearer, farther.end, farther.normal) > LEAST_OVERLAP;
}

// Whether a texel and any of its eight neighbours hide one another.
bool is_silhouette(ivec2 texel, float farthest) {
    MetSurface own = met_surface(SILHOUETTE_ENTRY(texel), texel, VISIBILITY_MAP_SIZE);
    ivec2 last = min(texel + 1, ivec2(VISIBILITY_MAP_SIZE - 1));
    for (int y = max(texel.y - 1, 0); y <= last.y; ++y) {
        for (int x = max(texel.x - 1, 0); x <= last.x; ++x) {
            ivec2 beside = ivec2(x, y);
            MetSurface other = met_surface(SILHOUETTE_ENTRY(beside), beside, VISIBILITY_MAP_SIZE);
            if (hides(own, other, farthest) || hides(other, own, farthest)) {
                return true;
            }
        }
    }
    return false;
}
