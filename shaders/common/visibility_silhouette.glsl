// Whether a silhouette runs through a visibility map's texel: what it met would shade what a neighbour met, or the
// other way round. One ray says too little there; a corner of a room, or an edge of a box that the VPL looks at,
// hides nothing. Reads entries by SILHOUETTE_ENTRY(texel).
#include "common/vpl_visibility.glsl"

// Overlap beyond which one surface hides another, of the distance: some times the bias of a lookup.
const float LEAST_OVERLAP = 2e-3;

// `farthest` [L]: what was met lies nearer; nothing lies farther, and is never hidden, since no receiver is there.
bool hides(MetSurface nearer, MetSurface farther, float farthest) {
    return length(farther.end) < farthest && surface_overlap(nearer, farther.end, farther.normal) > LEAST_OVERLAP;
}

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
