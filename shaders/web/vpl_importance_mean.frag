// Web page, VPL importance, part 4: the mean importance over the lit cells. One fragment.
//
// Reads: importance. Writes: its mean. Runtime: vpl_importance/vpl_importance_factor.comp, which also applies it.
uniform sampler2D importance;

layout(location = 0) out float out_mean;

void main() {
    ivec2 cells = textureSize(importance, 0);
    vec2 sum = vec2(0.0);
    for (int y = 0; y < cells.y; ++y) {
        vec2 sum_of_row = vec2(0.0);
        for (int x = 0; x < cells.x; ++x) {
            float one = texelFetch(importance, ivec2(x, y), 0).r;
            sum_of_row += one > 0.0 ? vec2(one, 1.0) : vec2(0.0);
        }
        sum += sum_of_row;
    }
    out_mean = sum.x / max(sum.y, 1.0);
}
