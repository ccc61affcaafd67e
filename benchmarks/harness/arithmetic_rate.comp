// Arithmetic rate: products and sums in eight chains (two of four lanes each), which wait for nothing but themselves.
//
// Writes: `sums`, so that no compiler drops the work. Python: benchmarks/harness/machine_rates.py.
#version 450 core
layout(local_size_x = 64) in;

layout(std430, binding = 0) writeonly buffer Sums {
    float sums[];
};

uniform float factor;
uniform int rounds;

void main() {
    vec4 a = vec4(float(gl_GlobalInvocationID.x), 1.0, 2.0, 3.0);
    vec4 b = a + 1.0;
    for (int round = 0; round < rounds; ++round) {
        // Written out: llvmpipe keeps no array in registers.
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
    }
    sums[gl_GlobalInvocationID.x] = dot(a + b, vec4(1.0));
}
