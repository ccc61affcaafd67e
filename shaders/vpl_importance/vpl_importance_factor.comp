// VPL importance, part 4: turns importance into the factor F of the sampling weight, in place. One workgroup.
//
// F = η · I / (flux-weighted mean of I) + max(1 - η, LEAST_IMPORTANCE). So a share η of all VPLs is drawn by flux times
// importance, and the rest by flux alone, however much of the light the camera would never miss (a defensive mixture,
// Hesterberg 1995).
// Reads: importance cells. Reads and writes: `vpl_importance`.
// Constants: LEAST_IMPORTANCE of renderer/frame/passes/vpl_importance.py. Python: the same.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"
#include "common/vpl_importance_buffers.glsl"

layout(local_size_x = 256) in;

uniform int cell_count;

shared vec2 sums[256];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    vec2 sum = vec2(0.0);
    for (int i = lane; i < cell_count; i += 256) {
        sum += importance_cells[i].position_flux.w * vec2(vpl_importance[i], 1.0);
    }
    sums[lane] = sum;
    barrier();
    for (int reach = 128; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] += sums[lane + reach]; }
        barrier();
    }
    // 1e-30: without light, any factor will do.
    float mean = sums[0].x / max(sums[0].y, 1e-30);
    float least = max(1.0 - artist.density_importance, LEAST_IMPORTANCE);
    for (int i = lane; i < cell_count; i += 256) {
        float share = mean > 0.0 ? vpl_importance[i] / mean : 1.0;
        vpl_importance[i] = artist.density_importance * share + least;
    }
}
