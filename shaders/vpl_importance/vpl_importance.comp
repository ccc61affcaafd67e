// VPL importance, part 3: how much error the image would have if the light of an importance cell were drawn too seldom.
//
// Reads: importance cells, receivers. Writes: importance I of each cell. One invocation for each cell.
// Constants: IMPORTANCE_RECEIVERS and IMPORTANCE_DARK_SHARE of renderer/frame/passes/vpl_importance.py.
// Python: renderer/frame/passes/vpl_importance.py. A numpy version: `importance` in examples/standalone_vpls.py.
// Source: Kahn and Marshall 1953 ("optimum importance function").
//
// N texels are drawn with probabilities p_i. Texel i gives E_i(x) to receiver x. The variance of the irradiance is
// Σ E_i(x)²/p_i / N - E(x)²/N. The relative error over the image, Σ_x Var(x) / (E(x)² + 0.01 mean(E²)), is least for
//     p_i ∝ sqrt(Σ_x E_i(x)² / (E(x)² + 0.01 mean(E²))) = Φ_i · I_i.
// The receivers x stand for the image; 0.01 is IMPORTANCE_DARK_SHARE.
#include "common/artist_parameters.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"
#include "common/vpl_importance_buffers.glsl"

layout(local_size_x = 64) in;

uniform int cell_count;

shared vec3 positions[IMPORTANCE_RECEIVERS];
shared vec4 normals_weights[IMPORTANCE_RECEIVERS];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    float squares = 0.0;
    float seen = 0.0;  // receivers that show a surface
    for (int i = 0; i < IMPORTANCE_RECEIVERS; ++i) {
        ImportanceReceiver receiver = importance_receivers[i];
        float irradiance = receiver.position_valid.w * receiver.normal_irradiance.w;
        squares += irradiance * irradiance;
        seen += receiver.position_valid.w;
    }
    // From the mean square and not the square of the mean: this also bounds the weight of black receivers where few
    // receivers are lit.
    float dark = IMPORTANCE_DARK_SHARE * squares / max(seen, 1.0);
    for (int i = lane; i < IMPORTANCE_RECEIVERS; i += 64) {
        ImportanceReceiver receiver = importance_receivers[i];
        positions[i] = receiver.position_valid.xyz;
        normals_weights[i] = vec4(receiver.normal_irradiance.xyz, receiver_weight(receiver, dark));
    }
    barrier();
    int index = int(gl_GlobalInvocationID.x);
    if (index >= cell_count) {
        return;
    }
    ImportanceCell cell = importance_cells[index];
    float sum = 0.0;
    if (cell.position_flux.w > 0.0) {
        for (int i = 0; i < IMPORTANCE_RECEIVERS; ++i) {
            float form = cell_form(positions[i], normals_weights[i].xyz, cell) * cell.normal_area.w;
            sum += normals_weights[i].w * form * form;
        }
        sum = sqrt(sum) / cell.normal_area.w;
    }
    vpl_importance[index] = sum;
}
