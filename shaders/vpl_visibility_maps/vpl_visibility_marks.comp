// Visibility maps, part 1: marks the texels that a visible receiver may look up. Boxes around the receivers are projected
// into each VPL's map. One workgroup for each VPL.
//
// Reads: VPLs, receiver bounds. Writes: `visibility_marks`.
// Constants: DISC_LARGEST_FALLOFF, the greatest α of renderer/config/artist_parameters.py.
// Python: renderer/frame/passes/vpl_visibility_maps.py.
#include "common/virtual_point_lights.glsl"
#include "common/vpl_visibility.glsl"
#include "common/receiver_bounds.glsl"
#include "common/visibility_marks.glsl"
#include "common/visibility_workgroup.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

shared uint marks[2 * VISIBILITY_MAP_SIZE];  // two words for each row

// The bits `first` to `last` of a word, as far as it has them.
uint bits_between(int first, int last) {
    if (first > 31 || last < 0) {
        return 0u;
    }
    first = max(first, 0);
    last = min(last, 31);
    return (0xFFFFFFFFu >> uint(31 - last + first)) << uint(first);
}

// The greatest u / (max(|u|, |v|) + z) for |v| and z >= 0 within bounds (x: least, y: greatest). It grows with u.
float greatest_place(float u, vec2 v, vec2 z) {
    float size = u > 0.0 ? max(u, v.x) + z.x : max(-u, v.y) + z.y;
    return u / max(size, 1e-30);
}

// Mark the texels in whose directions the box lies. `axes` are the columns x + y, x - y and z of the VPL's frame: with
// u and v along the first two, the hemi-octahedral map is (u, v) / (max(|u|, |v|) + z). `radius` is a disc's greatest.
void mark(ReceiverBounds box, vec3 origin, mat3 axes, float radius) {
    vec3 low = box.low.xyz - origin;
    vec3 high = box.high.xyz - origin;
    vec3 farthest = max(abs(low), abs(high));
    float margin = VISIBILITY_ROUNDING * (farthest.x + farthest.y + farthest.z);
    // The least dot product of offset and normal: where it is positive, all face away from the VPL's middle, and beyond
    // `radius` from all of a disc.
    vec3 facing = min(
        min(low * box.normal_low.xyz, low * box.normal_high.xyz),
        min(high * box.normal_low.xyz, high * box.normal_high.xyz));
    vec3 middle = 0.5 * (low + high) * axes;
    vec3 half_size = 0.5 * (high - low);
    vec3 reach = margin + vec3(
        dot(half_size, abs(axes[0])), dot(half_size, abs(axes[1])), dot(half_size, abs(axes[2])));
    vec3 from = middle - reach;
    vec3 to = middle + reach;
    if (facing.x + facing.y + facing.z > margin + radius || to.z < 0.0) {
        return;
    }
    vec2 nearest = max(max(from.xy, -to.xy), 0.0);
    vec2 outermost = max(abs(from.xy), abs(to.xy));
    vec2 heights = vec2(max(from.z, 0.0), to.z);
    vec2 across = vec2(nearest.y, outermost.y);
    vec2 along = vec2(nearest.x, outermost.x);
    vec2 first = -vec2(greatest_place(-from.x, across, heights), greatest_place(-from.y, along, heights));
    vec2 last = vec2(greatest_place(to.x, across, heights), greatest_place(to.y, along, heights));
    const float size = float(VISIBILITY_MAP_SIZE);
    ivec2 first_texel = ivec2(clamp((first * 0.5 + 0.5) * size, 0.0, size - 1.0));
    ivec2 last_texel = ivec2(clamp((last * 0.5 + 0.5) * size, 0.0, size - 1.0));
    uvec2 row = uvec2(
        bits_between(first_texel.x, last_texel.x), bits_between(first_texel.x - 32, last_texel.x - 32));
    for (int y = first_texel.y; y <= last_texel.y; ++y) {
        atomicOr(marks[2 * y], row.x);
        atomicOr(marks[2 * y + 1], row.y);
    }
}

void main() {
    int vpl_index = workgroup_vpl();
    if (vpl_index >= vpl_count) {
        return;
    }
    uint lane = gl_LocalInvocationIndex;
    // Where boxes are missing, any texel may be looked up.
    bool missing = receiver_bounds_count > uint(receiver_bounds.length());
    for (uint i = lane; i < uint(marks.length()); i += 64u) {
        marks[i] = missing ? 0xFFFFFFFFu : 0u;
    }
    barrier();
    VirtualPointLight vpl = virtual_point_lights[vpl_index];
    if (!missing && any(greaterThan(vpl.flux.rgb, vec3(0.0)))) {
        mat3 frame = hemisphere_frame(vpl.normal_area.xyz);
        mat3 axes = mat3(frame[0] + frame[1], frame[0] - frame[1], frame[2]);
        vec3 origin = visibility_origin(vpl);
        for (uint i = lane; i < receiver_bounds_count; i += 64u) {
            mark(receiver_bounds[i], origin, axes, DISC_LARGEST_FALLOFF * vpl.position_footprint.w);
        }
    }
    barrier();
    for (uint y = lane; y < uint(VISIBILITY_MAP_SIZE); y += 64u) {
        visibility_marks[vpl_index * VISIBILITY_MAP_SIZE + int(y)] = uvec2(marks[2u * y], marks[2u * y + 1u]);
    }
}
