// VPL importance, part 2: receivers spread over the image, and the indirect light that each gets, without visibility.
// One workgroup for each receiver.
//
// Reads: G-buffer, importance cells. Writes: receivers. Python: renderer/frame/passes/vpl_importance.py.
// Constants: R2_STEP_* of renderer/frame/point_table.py.
#include "common/gbuffer.glsl"

const float PI = 3.14159265358979;
#include "common/vpl_importance_buffers.glsl"

layout(local_size_x = 64) in;

uniform int cell_count;

shared float sums[64];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    int index = int(gl_WorkGroupID.x);
    ivec2 size = textureSize(gbuffer_depth, 0);
    // The R2 sequence (Roberts 2018): evenly spread pixels, the same ones in every frame.
    vec2 place = fract(0.5 + float(index + 1) * vec2(R2_STEP_X, R2_STEP_Y));
    Receiver receiver = gbuffer_receiver(min(ivec2(place * vec2(size)), size - 1));
    float irradiance = 0.0;
    for (int i = lane; i < cell_count; i += 64) {
        irradiance += disc_irradiance(receiver.position_world, receiver.normal_world, importance_cells[i]);
    }
    sums[lane] = irradiance;
    barrier();
    for (int reach = 32; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] += sums[lane + reach]; }
        barrier();
    }
    if (lane == 0) {
        // Without a surface, position and sum may be infinite or NaN.
        importance_receivers[index] = receiver.valid
            ? ImportanceReceiver(vec4(receiver.position_world, 1.0), vec4(receiver.normal_world, sums[0]))
            : ImportanceReceiver(vec4(0.0), vec4(0.0));
    }
}
