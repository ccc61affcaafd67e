// Web page: what common/vpl_placement.glsl needs, read from textures.
//
// Provides: `sum_in_row`, `sum_of_rows`, `sampling_weight`, `total_weight`, `vpl_count`, `rows`.
// Constants: IMPORTANCE_CELLS, LEAST_IMPORTANCE of renderer/frame/passes/vpl_importance.py.
uniform sampler2D sums_in_rows;   // running sums of the sampling weights along the rows of the RSM atlas
uniform sampler2D sums_of_rows;   // one column: running sums of the rows' totals
uniform int vpl_count;
uniform int rows;
uniform float density_exponent;
uniform float density_importance;
uniform sampler2D importance;       // one texel for each importance cell
uniform sampler2D mean_importance;  // one texel

float sum_in_row(int row, int column) {
    return texelFetch(sums_in_rows, ivec2(column, row), 0).r;
}

float sum_of_rows(int row) {
    return texelFetch(sums_of_rows, ivec2(0, row), 0).r;
}

// flux^γ times the importance factor. Runtime: common/vpl_importance.glsl and vpl_importance_factor.comp.
float sampling_weight(ivec2 texel, float flux) {
    float weight = pow(flux, density_exponent);
    if (density_importance > 0.0) {
        float mean = texelFetch(mean_importance, ivec2(0), 0).r;
        float own = texelFetch(importance, texel * IMPORTANCE_CELLS / RSM_RESOLUTION, 0).r;
        float least = max(1.0 - density_importance, LEAST_IMPORTANCE);
        weight *= density_importance * (mean > 0.0 ? own / mean : 1.0) + least;
    }
    return weight;
}

// The last running sum. The runtime has it in the frame statistics.
#define total_weight sum_of_rows(rows - 1)
