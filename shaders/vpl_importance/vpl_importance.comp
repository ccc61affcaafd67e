// VPL importance, part 3: how much error on the image a cell would leave if its light were drawn too seldom.
//
// Of N draws with chances p_i, of texels that give E_i(x), the variance of irradiance is Σ E_i(x)²/p_i / N - E(x)²/N.
// Relative error over the image, Σ_x Var(x) / (E(x)² + 0.01 mean(E)²), is least where
//     p_i ∝ sqrt(Σ_x E_i(x)² / (E(x)² + 0.01 mean(E)²)) = Φ_i · I_i
// (Kahn and Marshall 1953, "optimum importance function"; the sum is over the points that stand for the image).
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
    float seen = 0.0;
    for (int i = 0; i < IMPORTANCE_RECEIVERS; ++i) {
        ImportanceReceiver receiver = importance_receivers[i];
        float irradiance = receiver.position_valid.w * receiver.normal_irradiance.w;
        squares += irradiance * irradiance;
        seen += receiver.position_valid.w;
    }
    // The mean square, not the square of the mean: where few points are lit both keep black ones at bay.
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
