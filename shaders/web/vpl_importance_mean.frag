// Web page, VPL importance, part 4: the flux-weighted mean importance over the cells. One fragment.
//
// Reads: importance, importance cells. Writes: its mean. Runtime: vpl_importance/vpl_importance_factor.comp, which also
// applies it.
uniform sampler2D importance;
uniform sampler2D cell_position_flux;

layout(location = 0) out float out_mean;

void main() {
    ivec2 cells = textureSize(importance, 0);
    vec2 sum = vec2(0.0);
    for (int y = 0; y < cells.y; ++y) {
        vec2 sum_of_row = vec2(0.0);
        for (int x = 0; x < cells.x; ++x) {
            float flux = texelFetch(cell_position_flux, ivec2(x, y), 0).w;
            sum_of_row += flux * vec2(texelFetch(importance, ivec2(x, y), 0).r, 1.0);
        }
        sum += sum_of_row;
    }
    out_mean = sum.x / max(sum.y, 1e-30);
}
