// One step of an inclusive scan (Hillis and Steele 1986): each texel adds the one `reach` before it.
uniform sampler2D values;
uniform ivec2 reach;
uniform ivec2 first;  // of the column that is read: (0, 0), or that of the rows' totals

layout(location = 0) out float out_sum;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + first;
    ivec2 before = texel - reach;
    out_sum = texelFetch(values, texel, 0).r;
    if (reach != ivec2(0) && all(greaterThanEqual(before, ivec2(0)))) {
        out_sum += texelFetch(values, before, 0).r;
    }
}
