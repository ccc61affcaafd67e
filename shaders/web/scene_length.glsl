// Web page: the scene length L from the sums of the moments.
//
// Provides: `measured_scene_length` [world units]. Runtime: virtual_point_lights/vpl_marginal_density.comp.
uniform sampler2D flux_position;
uniform sampler2D flux_square;

float measured_scene_length() {
    vec4 sum = texelFetch(flux_position, ivec2(0), 0);
    if (!(sum.w > 0.0)) {
        return 1.0;
    }
    vec3 mean_position = sum.xyz / sum.w;
    float mean_square = texelFetch(flux_square, ivec2(0), 0).r / sum.w;
    return sqrt(max(mean_square - dot(mean_position, mean_position), 1e-12 * mean_square));
}
