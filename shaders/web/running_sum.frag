// Web page: one step of an inclusive scan (Hillis and Steele 1986). Each texel adds the texel `reach` before it; a
// reach of 0 copies.
//
// Reads: `values`. Writes: their partial sums. Runtime: the scan in virtual_point_lights/vpl_row_density.comp.
uniform sampler2D values;
uniform ivec2 reach;
uniform ivec2 first;  // offset of the texels that are read: (0, 0), or the last column to copy the rows' totals

layout(location = 0) out float out_sum;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + first;
    ivec2 before = texel - reach;
    out_sum = texelFetch(values, texel, 0).r;
    if (reach != ivec2(0) && all(greaterThanEqual(before, ivec2(0)))) {
        out_sum += texelFetch(values, before, 0).r;
    }
}
