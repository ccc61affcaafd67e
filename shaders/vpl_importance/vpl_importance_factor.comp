// VPL importance, part 4: turns importance into the factor F of the sampling weight, in place. One workgroup.
//
// F = (I / mean I of the lit cells + LEAST_IMPORTANCE)^η. Reads and writes: `vpl_importance`.
// Constants: LEAST_IMPORTANCE of renderer/frame/passes/vpl_importance.py. Python: the same.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"

layout(local_size_x = 256) in;

uniform int cell_count;

shared vec2 sums[256];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    vec2 sum = vec2(0.0);
    for (int i = lane; i < cell_count; i += 256) {
        float importance = vpl_importance[i];
        sum += importance > 0.0 ? vec2(importance, 1.0) : vec2(0.0);
    }
    sums[lane] = sum;
    barrier();
    for (int reach = 128; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] += sums[lane + reach]; }
        barrier();
    }
    float mean = sums[0].x / max(sums[0].y, 1.0);
    for (int i = lane; i < cell_count; i += 256) {
        float share = mean > 0.0 ? vpl_importance[i] / mean : 1.0;
        vpl_importance[i] = pow(share + LEAST_IMPORTANCE, artist.density_importance);
    }
}
