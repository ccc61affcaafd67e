// Cells of light around VPLs: samples of the RSM, each of which belongs to the VPL that is nearest to it.
#include "common/virtual_point_lights.glsl"

// How far apart two surface elements are [L²]: opposite ones count 2 · NORMAL_REACH apart on top of their distance,
// so that a cell does not go round a corner, where light leaves in another direction.
float cell_distance(vec3 between, vec3 normal, vec3 other_normal, float length_squared) {
    return dot(between, between) / length_squared
         + 2.0 * NORMAL_REACH * NORMAL_REACH * (1.0 - dot(normal, other_normal));
}

// What the samples of a cell add up to.
struct CellSums {
    vec4 offset_count;   // offset: from where the VPL was, near to which nothing is rounded off
    vec4 normal_square;  // squares: of the offset, and half of the sample's own disc's
    vec4 flux;
};

const CellSums NO_SAMPLES = CellSums(vec4(0.0), vec4(0.0), vec4(0.0));

CellSums joined(CellSums one, CellSums other) {
    return CellSums(
        one.offset_count + other.offset_count, one.normal_square + other.normal_square, one.flux + other.flux);
}

CellSums with_sample(CellSums sums, VirtualPointLight one, vec3 before) {
    vec3 offset = one.position_footprint.xyz - before;
    float footprint = one.position_footprint.w;
    float square = dot(offset, offset) + 0.5 * footprint * footprint;
    return joined(sums, CellSums(vec4(offset, 1.0), vec4(one.normal_area.xyz, square), one.flux));
}

// Where the middle is, from where the VPL was.
vec3 cell_offset(CellSums sums) {
    return sums.offset_count.xyz / max(sums.offset_count.w, 1.0);
}

vec3 cell_normal(CellSums sums) {
    // Normals that cancel leave the distance to decide.
    return sums.normal_square.xyz / max(length(sums.normal_square.xyz), 1e-30);
}

// The VPL in the middle of a cell, of which `one` is the sample nearest to there.
VirtualPointLight cell_vpl(CellSums sums, vec3 before, VirtualPointLight one) {
    vec3 offset = cell_offset(sums);
    // To the middle itself over the plane of the sample next to it, but within that sample's disc: the middle of
    // what surrounds a box lies in the box.
    vec3 slide = before + offset - one.position_footprint.xyz;
    slide -= one.normal_area.xyz * dot(one.normal_area.xyz, slide);
    slide *= min(1.0, one.position_footprint.w / max(length(slide), 1e-30));
    // A disc has a spread of half its radius squared.
    float spread = max(sums.normal_square.w / sums.offset_count.w - dot(offset, offset), 0.0);
    return VirtualPointLight(
        vec4(one.position_footprint.xyz + slide, sqrt(2.0 * spread)),
        vec4(one.normal_area.xyz, 2.0 * PI * spread),
        sums.flux);
}
