// Clustered disc lights: RSM samples grouped by their nearest VPL; each group becomes one VPL that shines as a disc.
//
// Provides: `cluster_distance`, `middle_distance`, `ClusterSums` and what is computed from them, and
// `clustered_disc`. Needs PI.
// Constants: NORMAL_REACH, OFF_PLANE_FACTOR and SAMPLE_REACH of renderer/frame/disc_samples.py.
// Python: renderer/frame/passes/clustered_discs.py. A numpy version: `relaxed` in examples/standalone_vpls.py.
// Source: Lloyd 1982 for the iterations; Dong et al. 2009 ("Interactive indirect illumination using clustered
// visibility") make virtual area lights from RSMs this way.
#include "common/virtual_point_lights.glsl"

// Squared distance of a sample from a cluster's middle, in units of the squared `cluster_length`. Normals count too:
// opposite normals add (2 · NORMAL_REACH)². This keeps a cluster on one side of an edge, where all its light leaves in
// similar directions.
float middle_distance(vec3 between, vec3 normal, vec3 other_normal, float length_squared) {
    return dot(between, between) / length_squared
         + 2.0 * NORMAL_REACH * NORMAL_REACH * (1.0 - dot(normal, other_normal));
}

// Squared distance of a sample from a VPL, in the same units. Offsets from either one's plane count more than those along
// it: a disc is flat, and where its samples are not, as in the folds of a curtain, it sticks out of the surface on both
// sides. Not so to a cluster's middle: around a corner, which sample is nearest to it would change with rounding.
float cluster_distance(vec3 between, vec3 normal, vec3 other_normal, float length_squared) {
    float off_plane = OFF_PLANE_FACTOR * max(abs(dot(between, normal)), abs(dot(between, other_normal)));
    return middle_distance(between, normal, other_normal, length_squared) + off_plane * off_plane / length_squared;
}

// The length that a sample's distances are measured in: L, but at most SAMPLE_REACH of its own footprints. L may be that
// of kilometres of ground, and a window's reveal may face the same way as the sunlit wall beside it.
float cluster_length(float scene_length, VirtualPointLight one) {
    return min(scene_length, SAMPLE_REACH * one.position_footprint.w);
}

// Sums over the samples of one cluster. Offsets are relative to the VPL's previous position: they are short, so float32
// sums lose few digits.
struct ClusterSums {
    vec4 offset_count;   // Σ offset [world units]; number of samples, each by its weight
    vec4 normal_square;  // Σ unit normal; Σ |offset|² [world units²]
    vec4 flux_square;    // Σ flux [W]; Σ l²/2 [world units²], the spread of the samples' own discs
};

// An empty cluster: the neutral element of `joined`.
const ClusterSums NO_SAMPLES = ClusterSums(vec4(0.0), vec4(0.0), vec4(0.0));

ClusterSums joined(ClusterSums one, ClusterSums other) {
    return ClusterSums(
        one.offset_count + other.offset_count, one.normal_square + other.normal_square,
        one.flux_square + other.flux_square);
}

// `sums` with one more sample; `before` is the VPL's previous position. Samples whose flux differs a lot have a weight in
// `flux.w` (light_walks/walk_statistics.comp); the others have 0 there, and all count alike.
ClusterSums with_sample(ClusterSums sums, VirtualPointLight one, vec3 before) {
    vec3 offset = one.position_footprint.xyz - before;
    float footprint = one.position_footprint.w;
    float weight = one.flux.w > 0.0 ? one.flux.w : 1.0;
    return joined(sums, ClusterSums(
        vec4(offset, 1.0) * weight, vec4(one.normal_area.xyz, dot(offset, offset)) * weight,
        vec4(one.flux.rgb, 0.5 * footprint * footprint * weight)));
}

// The cluster's centroid, relative to the VPL's previous position.
vec3 cluster_offset(ClusterSums sums) {
    return sums.offset_count.xyz / max(sums.offset_count.w, 1e-30);
}

// The cluster's mean direction.
vec3 cluster_normal(ClusterSums sums) {
    // Where normals cancel, the result is near 0 and only positions count in `middle_distance`.
    return sums.normal_square.xyz / max(length(sums.normal_square.xyz), 1e-30);
}

// Mean squared distance of a cluster's light from its centroid: that of its samples, and that within their own discs. Each
// disc has 1/n of the area, and so adds 1/n to the spread. Where several lights shine on one place, the discs of their
// samples overlap and are too large; twice that share is the most that counts.
float cluster_spread(ClusterSums sums) {
    float count = sums.offset_count.w;
    vec3 offset = cluster_offset(sums);
    float between = max(sums.normal_square.w / count - dot(offset, offset), 0.0);
    float within = sums.flux_square.w / count;
    return between + (count > 1.0 ? min(within, 2.0 * between / count) : within);
}

// The clustered disc light: it has the flux of its samples and the radius of their spread. It lies on the surface of
// `one`, the sample nearest to the centroid.
VirtualPointLight clustered_disc(ClusterSums sums, vec3 before, VirtualPointLight one) {
    vec3 offset = cluster_offset(sums);
    // Slide along the plane of that sample towards the centroid, but stay within the sample's disc: the centroid of
    // samples all round a box lies inside the box.
    vec3 slide = before + offset - one.position_footprint.xyz;
    slide -= one.normal_area.xyz * dot(one.normal_area.xyz, slide);
    slide *= min(1.0, one.position_footprint.w / max(length(slide), 1e-30));
    float spread = cluster_spread(sums);  // that of an even disc is half its radius squared
    return VirtualPointLight(
        vec4(one.position_footprint.xyz + slide, sqrt(2.0 * spread)),
        vec4(one.normal_area.xyz, 2.0 * PI * spread),
        vec4(sums.flux_square.rgb, 0.0));
}
