// Web page, VPL importance, part 2: receivers spread over the image, and the indirect light that each gets.
//
// Reads: G-buffer, importance cells. Writes: receivers. Runtime: vpl_importance/vpl_importance_receivers.comp.
#include "common/gbuffer.glsl"

const float PI = 3.14159265358979;
#include "web/vpl_importance_texture.glsl"

layout(location = 0) out vec4 out_position_valid;
layout(location = 1) out vec4 out_normal_irradiance;

void main() {
    ivec2 size = textureSize(gbuffer_depth, 0);
    // The R2 sequence (Roberts 2018): evenly spread pixels, the same ones in every frame.
    vec2 place = fract(0.5 + float(int(gl_FragCoord.x) + 1) * vec2(R2_STEP_X, R2_STEP_Y));
    Receiver receiver = gbuffer_receiver(min(ivec2(place * vec2(size)), size - 1));
    out_position_valid = vec4(0.0);
    out_normal_irradiance = vec4(0.0);
    if (!receiver.valid) {
        return;
    }
    ivec2 cells = textureSize(cell_position_flux, 0);
    float irradiance = 0.0;
    for (int y = 0; y < cells.y; ++y) {
        for (int x = 0; x < cells.x; ++x) {
            irradiance += disc_irradiance(
                receiver.position_world, receiver.normal_world, importance_cell_at(ivec2(x, y)));
        }
    }
    out_position_valid = vec4(receiver.position_world, 1.0);
    out_normal_irradiance = vec4(receiver.normal_world, irradiance);
}
