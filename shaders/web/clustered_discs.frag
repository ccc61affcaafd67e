// Web page, clustered disc lights, part 2 of a Lloyd iteration: each VPL takes the light of its samples and moves to
// their centroid. One fragment for each VPL; it reads every sample.
//
// Reads: samples, their owners, VPLs, moments. Writes: VPLs. Runtime: clustered_discs/clustered_discs.comp.
// Constants: VPL_COLUMNS of renderer/export/web_page/web_page.py.
const float PI = 3.14159265358979;
#include "common/clustered_discs.glsl"
#include "web/scene_length.glsl"
#include "web/vpl_samples.glsl"
#include "web/vpl_texture.glsl"

uniform highp isampler2D vpl_owners;
uniform int vpl_count;
uniform int sample_rows;

layout(location = 0) out vec4 out_position_footprint;
layout(location = 1) out vec4 out_normal_area;
layout(location = 2) out vec4 out_flux;

// The sample of the VPL's cluster that is nearest to the centroid; the first of equally near ones; -1 without any.
ivec2 sample_nearest_to(int vpl_index, vec3 middle, vec3 normal) {
    float scene_length = measured_scene_length();
    float nearest = 1e30;
    ivec2 found = ivec2(-1);
    for (int row = 0; row < sample_rows; ++row) {
        for (int column = 0; column < VPL_COLUMNS; ++column) {
            ivec2 texel = ivec2(column, row);
            if (texelFetch(vpl_owners, texel, 0).r == vpl_index) {
                VirtualPointLight one = sample_at(texel);
                float one_length = cluster_length(scene_length, one);
                float away = middle_distance(
                    one.position_footprint.xyz - middle, one.normal_area.xyz, normal, one_length * one_length);
                if (away < nearest) {
                    nearest = away;
                    found = texel;
                }
            }
        }
    }
    return found;
}

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    int vpl_index = place.y * VPL_COLUMNS + place.x;
    VirtualPointLight vpl = NO_VPL;
    if (vpl_index < vpl_count) {
        vec3 before = vpl_at(vpl_index).position_footprint.xyz;
        ClusterSums sums = NO_SAMPLES;
        for (int row = 0; row < sample_rows; ++row) {
            // Row by row, because a sum of sums loses fewer digits.
            ClusterSums sums_of_row = NO_SAMPLES;
            for (int column = 0; column < VPL_COLUMNS; ++column) {
                ivec2 texel = ivec2(column, row);
                if (texelFetch(vpl_owners, texel, 0).r == vpl_index) {
                    sums_of_row = with_sample(sums_of_row, sample_at(texel), before);
                }
            }
            sums = joined(sums, sums_of_row);
        }
        ivec2 middle = sample_nearest_to(vpl_index, before + cluster_offset(sums), cluster_normal(sums));
        if (middle.x >= 0) {
            vpl = clustered_disc(sums, before, sample_at(middle));
        }
    }
    out_position_footprint = vpl.position_footprint;
    out_normal_area = vpl.normal_area;
    out_flux = vpl.flux;
}
