// Automatic exposure: scales the mean luminance of the pixels that show a surface to EXPOSURE_KEY. One workgroup.
//
// Reads: radiance. Writes: exposure, a factor.
// Constants: EXPOSURE_KEY of renderer/frame/passes/tone_mapping.py.
// Python: renderer/frame/passes/tone_mapping.py. In the web page: `measuredExposure` of page.js.
layout(local_size_x = 256) in;

uniform sampler2D radiance;

layout(std430, binding = EXPOSURE_BINDING) writeonly buffer Exposure {
    float exposure;
};

shared vec2 sums[256];

void main() {
    ivec2 size = textureSize(radiance, 0);
    int lane = int(gl_LocalInvocationIndex);
    vec2 sum = vec2(0.0);  // luminance with the weights of Rec. 709; pixels with a surface
    for (int i = lane; i < size.x * size.y; i += 256) {
        vec4 texel = texelFetch(radiance, ivec2(i % size.x, i / size.x), 0);
        sum += vec2(dot(texel.rgb, vec3(0.2126, 0.7152, 0.0722)), texel.a);
    }
    sums[lane] = sum;
    barrier();
    for (int reach = 128; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] += sums[lane + reach]; }
        barrier();
    }
    if (lane == 0) {
        exposure = sums[0].x > 0.0 ? EXPOSURE_KEY * sums[0].y / sums[0].x : 1.0;
    }
}
