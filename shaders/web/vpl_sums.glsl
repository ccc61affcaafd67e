// What shaders/common/vpl_placement.glsl asks for, from textures.
uniform sampler2D sums_in_rows;   // running sums of the sampling weights along the rows of the RSM atlas
uniform sampler2D sums_of_rows;   // one column: running sums of the rows' totals
uniform int vpl_count;
uniform int rows;
uniform float density_exponent;

float sum_in_row(int row, int column) {
    return texelFetch(sums_in_rows, ivec2(column, row), 0).r;
}

float sum_of_rows(int row) {
    return texelFetch(sums_of_rows, ivec2(0, row), 0).r;
}

float sampling_weight(ivec2 texel, float flux) {
    return pow(flux, density_exponent);
}

#define total_weight sum_of_rows(rows - 1)
