// Web page, VPL importance, part 3: the error in the image if an importance cell's light is drawn too seldom.
//
// Reads: importance cells, receivers. Writes: importance. One fragment for each cell.
// Runtime and formula: vpl_importance/vpl_importance.comp.
const float PI = 3.14159265358979;
#include "web/vpl_importance_texture.glsl"

uniform sampler2D receiver_position_valid;
uniform sampler2D receiver_normal_irradiance;

layout(location = 0) out float out_importance;

ImportanceReceiver receiver_at(int index) {
    return ImportanceReceiver(
        texelFetch(receiver_position_valid, ivec2(index, 0), 0),
        texelFetch(receiver_normal_irradiance, ivec2(index, 0), 0));
}

void main() {
    ImportanceCell cell = importance_cell_at(ivec2(gl_FragCoord.xy));
    out_importance = 0.0;
    if (!(cell.position_flux.w > 0.0)) {
        return;
    }
    float squares = 0.0;
    float seen = 0.0;
    for (int i = 0; i < IMPORTANCE_RECEIVERS; ++i) {
        ImportanceReceiver receiver = receiver_at(i);
        squares += receiver.normal_irradiance.w * receiver.normal_irradiance.w;
        seen += receiver.position_valid.w;
    }
    float dark = IMPORTANCE_DARK_SHARE * squares / max(seen, 1.0);
    float sum = 0.0;
    for (int i = 0; i < IMPORTANCE_RECEIVERS; ++i) {
        ImportanceReceiver receiver = receiver_at(i);
        float form = cell_form(receiver.position_valid.xyz, receiver.normal_irradiance.xyz, cell) * cell.normal_area.w;
        sum += receiver_weight(receiver, dark) * form * form;
    }
    out_importance = sqrt(sum) / cell.normal_area.w;
}
