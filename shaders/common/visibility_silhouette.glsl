// Silhouettes in a visibility map. One runs through a texel if the surface that its ray hit shades the surface that a
// neighbour's ray hit, or the other way round. Another runs where one of the two rays hits nothing: a receiver in the
// texel may be inside of what the other ray hits. There, one ray says too little. The corner of a room, or the edge of a
// box that faces the VPL, hides nothing and is no silhouette. A concave corner, such as a room's or a wall's foot, hides
// what is behind it: no texel is finer for it, but it is marked.
//
// Provides: `is_silhouette`, `corner_mark`. The including file defines SILHOUETTE_ENTRY(texel), which reads a map's entry.
#include "common/vpl_visibility.glsl"

// A choice: the overlap beyond which one surface hides another, as a share of the distance. It is four times the
// default of visibility_bias.
const float LEAST_OVERLAP = 2e-3;

// Whether the surface `nearer` shades the surface `farther`. Rays that hit something end within `farthest` [L]. A ray
// that hit nothing ends beyond it and is never hidden, because no receiver is there.
bool hides(MetSurface nearer, MetSurface farther, float farthest) {
    return length(farther.end) < farthest && surface_overlap(nearer, farther.end, farther.normal) > LEAST_OVERLAP;
}

// Whether a texel and any of its eight neighbours hide one another, or one hits something and the other nothing.
bool is_silhouette(ivec2 texel, float farthest) {
    MetSurface own = met_surface(SILHOUETTE_ENTRY(texel), texel, VISIBILITY_MAP_SIZE);
    ivec2 last = min(texel + 1, ivec2(VISIBILITY_MAP_SIZE - 1));
    for (int y = max(texel.y - 1, 0); y <= last.y; ++y) {
        for (int x = max(texel.x - 1, 0); x <= last.x; ++x) {
            ivec2 beside = ivec2(x, y);
            MetSurface other = met_surface(SILHOUETTE_ENTRY(beside), beside, VISIBILITY_MAP_SIZE);
            bool one_misses = (length(own.end) < farthest) != (length(other.end) < farthest);
            if (one_misses || hides(own, other, farthest) || hides(other, own, farthest)) {
                return true;
            }
        }
    }
    return false;
}

// A choice: two planes at 8° or more are two sides of a corner.
const float CORNER_COSINE = 0.99;

// Whether two hits are on two sides of a concave corner.
bool is_corner(MetSurface met, MetSurface other) {
    return dot(met.normal, other.normal) < CORNER_COSINE && !is_behind(met, other) && !is_behind(other, met);
}

// The corner mark of a texel.
uint corner_mark(ivec2 texel, float farthest) {
    MetSurface own = met_surface(SILHOUETTE_ENTRY(texel), texel, VISIBILITY_MAP_SIZE);
    if (!(length(own.end) < farthest)) {
        return 0u;
    }
    uint mark = 0u;
    for (uint vertex = 0u; vertex < 4u; ++vertex) {
        ivec2 beyond = texel + ivec2((vertex & 1u) != 0u ? 1 : -1, (vertex & 2u) != 0u ? 1 : -1);
        MetSurface first = own;
        for (int i = 1; i < 4; ++i) {
            ivec2 beside = ivec2((i & 1) != 0 ? beyond.x : texel.x, (i & 2) != 0 ? beyond.y : texel.y);
            if (any(lessThan(beside, ivec2(0))) || any(greaterThanEqual(beside, ivec2(VISIBILITY_MAP_SIZE)))) {
                continue;
            }
            MetSurface other = met_surface(SILHOUETTE_ENTRY(beside), beside, VISIBILITY_MAP_SIZE);
            if (!(length(other.end) < farthest && is_corner(own, other))) {
                continue;
            }
            if (is_corner(first, other) && first != own) {
                mark = VISIBILITY_FIRST_VERTEX + vertex;
            }
            first = other;
            mark = max(mark, VISIBILITY_NEAREST_VERTEX);
        }
    }
    return mark;
}
