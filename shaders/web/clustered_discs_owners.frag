// Web page, clustered disc lights, part 1 of a Lloyd iteration: the nearest VPL of each sample; -1 for a dark sample.
//
// Reads: samples, VPLs, moments. Writes: owners. Runtime: clustered_discs/clustered_discs_owners.comp.
const float PI = 3.14159265358979;
#include "common/clustered_discs.glsl"
#include "web/scene_length.glsl"
#include "web/vpl_samples.glsl"
#include "web/vpl_texture.glsl"

uniform int vpl_count;

layout(location = 0) out int out_owner;

void main() {
    VirtualPointLight own = sample_at(ivec2(gl_FragCoord.xy));
    float own_length = cluster_length(measured_scene_length(), own);
    float nearest = 1e30;
    int owner = -1;
    for (int i = 0; i < vpl_count; ++i) {
        VirtualPointLight vpl = vpl_at(i);
        vec3 between = own.position_footprint.xyz - vpl.position_footprint.xyz;
        float away = cluster_distance(
            between, own.normal_area.xyz, vpl.normal_area.xyz, own_length * own_length);
        if (away < nearest && vpl.normal_area.w > 0.0) {
            nearest = away;
            owner = i;
        }
    }
    out_owner = own.normal_area.w > 0.0 ? owner : -1;
}
