// VPL importance, part 5, in a clip whose lights stand still: keeps the importance factors F of the frame before while they
// will do. One workgroup.
//
// F is measured at few receivers, which move with the camera. So it differs a little in every frame, and the clusters of
// samples drawn with it change. The light is right with any F; only its error grows as F becomes stale. So F stays as it
// is until a share LARGEST_LAG of the samples would be drawn elsewhere with that of this frame. With the densities p and q,
// flux · F normalised over all cells, this share is their total variation distance, Σ |p - q| / 2.
// Reads: importance cells. Reads and writes: `vpl_importance`, `carried_importance`.
// Constants: LARGEST_LAG of renderer/frame/passes/vpl_importance.py. Python: the same.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"
#include "common/vpl_importance_buffers.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = CARRIED_IMPORTANCE_BINDING) buffer CarriedImportance {
    float carried_importance[];  // as `vpl_importance`
};

uniform int cell_count;

shared vec2 sums[256];

// The sum of `own` over the workgroup.
vec2 summed(int lane, vec2 own) {
    barrier();
    sums[lane] = own;
    barrier();
    for (int reach = 128; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] += sums[lane + reach]; }
        barrier();
    }
    return sums[0];
}

void main() {
    int lane = int(gl_LocalInvocationIndex);
    vec2 total = vec2(0.0);  // Σ flux · F, with F of this frame and with the carried one
    for (int i = lane; i < cell_count; i += 256) {
        total += importance_cells[i].position_flux.w * vec2(vpl_importance[i], carried_importance[i]);
    }
    total = summed(lane, total);
    vec2 lag = vec2(0.0);  // in x
    for (int i = lane; i < cell_count; i += 256) {
        // 1e-30: without light, any factor will do.
        vec2 density = vec2(vpl_importance[i], carried_importance[i]) / max(total, 1e-30);
        lag.x += 0.5 * importance_cells[i].position_flux.w * abs(density.x - density.y);
    }
    lag = summed(lane, lag);
    bool kept = lag.x <= LARGEST_LAG;
    for (int i = lane; i < cell_count; i += 256) {
        if (kept) {
            vpl_importance[i] = carried_importance[i];
        } else {
            carried_importance[i] = vpl_importance[i];
        }
    }
}
