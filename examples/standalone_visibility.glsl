// The visibility maps of standalone_reader.py: a small map of the surfaces that each VPL's hemisphere sees.
// CASTING sends one ray through each texel, against every triangle, which is short but slow. Where the surface in one
// texel hides that in its neighbour, MARKING replaces the texel by a block of finer ones, and REFINING casts those.
// LIGHTING looks up the map in the direction of a pixel. The program defines the config's parameters, scene_length,
// map_size (texels along the side, or 0), map_refinement (texels along the side of a block) and map_blocks, the room
// for blocks.

#if defined(CASTING) || defined(MARKING) || defined(REFINING) || defined(LIGHTING)
layout(std430, binding = 4) readonly buffer Vpls { vec4 vpls[]; };  // position, footprint; normal; flux
// The hit of each ray: normal, distance. A negative distance is -1 - the index of a block. Blocks follow all maps.
layout(std430, binding = 5) coherent buffer Maps { vec4 maps[]; };
const int map_texels = map_size * map_size, block_texels = map_refinement * map_refinement;

int block_start(float number) { return vpls.length() / 3 * map_texels + int(number) * block_texels; }

// The origin of a VPL's rays, lifted off its own surface.
vec3 map_origin(int vpl) {
    return vpls[vpl].xyz + vpls[vpl + 1].xyz * (0.01 * vpls[vpl].w);
}

// Columns: two tangents and the normal (Duff et al. 2017).
mat3 map_frame(vec3 n) {
    float s = n.z >= -0.5 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z), b = n.x * n.y * a;
    return mat3(1.0 + s * n.x * n.x * a, s * b, -s * n.x, b, s + n.y * n.y * a, -n.y, n);
}

// The direction of a texel's ray: the hemisphere on the square [-1, 1]² (Cigolle et al. 2014, "hemi-oct").
vec3 map_axis(ivec2 texel, int size) {
    vec2 place = (vec2(texel) + 0.5) * (2.0 / float(size)) - 1.0;
    vec2 p = vec2(place.x + place.y, place.x - place.y) * 0.5;
    return normalize(vec3(p, 1.0 - abs(p.x) - abs(p.y)));
}

// The lesser of two heights, as a share of the distance: of the hit in front of the other surface's plane, and of that
// surface behind the plane of the hit.
float overlap(vec3 end, vec3 plane, vec3 hidden, vec3 hidden_normal) {
    return min(dot(end - hidden, hidden_normal), dot(end - hidden, plane)) / length(hidden);
}
#endif

#if defined(CASTING) || defined(REFINING)
layout(std430, binding = 2) readonly buffer Positions { float positions[]; };
layout(std430, binding = 3) readonly buffer Triangles { uint triangles[]; };

vec3 corner(int i) {
    uint first = 3u * triangles[i];
    return vec3(positions[first], positions[first + 1u], positions[first + 2u]);
}

// The hit of a VPL's ray through a texel. One ray for each invocation, because Mesa's llvmpipe ends a loop after 65,535
// iterations in one invocation.
vec4 met_along(int vpl, ivec2 texel, int size) {
    vec3 origin = map_origin(vpl), ray = map_frame(vpls[vpl + 1].xyz) * map_axis(texel, size);
    // A ray that hits nothing ends at a wall far outside that faces it: no pixel is behind it.
    vec4 met = vec4(-ray, 1e6 * scene_length);
    for (int i = 0; i < triangles.length(); i += 3) {  // Möller and Trumbore 1997
        vec3 a = corner(i), to_b = corner(i + 1) - a, to_c = corner(i + 2) - a;
        vec3 across = cross(ray, to_c), turned = cross(origin - a, to_b);
        float scale = 1.0 / dot(to_b, across);
        float u = scale * dot(origin - a, across), v = scale * dot(ray, turned), t = scale * dot(to_c, turned);
        if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < met.w) {
            vec3 plane = normalize(cross(to_b, to_c));
            met = vec4(dot(plane, ray) > 0.0 ? -plane : plane, t);
        }
    }
    return met;
}
#endif

#ifdef CASTING
layout(local_size_x = map_size) in;

void main() {
    ivec2 texel = ivec2(gl_LocalInvocationID.x, gl_WorkGroupID.y);
    int vpl = int(gl_WorkGroupID.x);
    maps[vpl * map_texels + texel.y * map_size + texel.x] = met_along(3 * vpl, texel, map_size);
}
#endif

#ifdef REFINING
layout(local_size_x = map_refinement, local_size_y = map_refinement) in;

void main() {
    ivec2 coarse = ivec2(gl_WorkGroupID.y % map_size, gl_WorkGroupID.y / map_size);
    ivec2 inside = ivec2(gl_LocalInvocationID.xy);
    int vpl = int(gl_WorkGroupID.x);
    float number = maps[vpl * map_texels + int(gl_WorkGroupID.y)].w;
    if (number < 0.0) {
        vec4 met = met_along(3 * vpl, coarse * map_refinement + inside, map_size * map_refinement);
        maps[block_start(-1.0 - number) + inside.y * map_refinement + inside.x] = met;
    }
}
#endif

#ifdef MARKING
layout(local_size_x = 64) in;
layout(std430, binding = 6) buffer Counted { uint counted; };
shared bool is_edge[map_texels];

bool hides(ivec2 texel, ivec2 other, int start, mat3 frame) {
    vec4 nearer = maps[start + texel.y * map_size + texel.x], farther = maps[start + other.y * map_size + other.x];
    vec3 end = frame * map_axis(texel, map_size) * nearer.w, hidden = frame * map_axis(other, map_size) * farther.w;
    return farther.w < 1e5 * scene_length && overlap(end, nearer.xyz, hidden, farther.xyz) > 2e-3;
}

void main() {
    int vpl = 3 * int(gl_WorkGroupID.x), start = vpl / 3 * map_texels, lane = int(gl_LocalInvocationID.x);
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    for (int i = lane; i < map_texels; i += 64) {
        ivec2 texel = ivec2(i % map_size, i / map_size);
        is_edge[i] = false;
        for (int k = 0; k < 9; ++k) {
            ivec2 beside = clamp(texel + ivec2(k % 3, k / 3) - 1, ivec2(0), ivec2(map_size - 1));
            is_edge[i] = is_edge[i] || hides(texel, beside, start, frame) || hides(beside, texel, start, frame);
        }
    }
    barrier();
    for (int i = lane; i < map_texels; i += 64) {
        uint block = is_edge[i] ? atomicAdd(counted, 1u) : uint(map_blocks);
        if (block < uint(map_blocks)) { maps[start + i].w = -1.0 - float(block); }
    }
}
#endif

#ifdef LIGHTING
// Share of a VPL's light that reaches a pixel. The hit of the nearest ray shades it if each is behind the other's
// plane.
float visibility(int vpl, vec3 position, vec3 normal) {
    if (map_size == 0) { return 1.0; }
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    vec3 offset = position - map_origin(vpl);
    vec3 towards = offset * frame;
    if (towards.z <= 0.0 || dot(offset, normal) >= 0.0) { return 1.0; }
    vec2 p = towards.xy / (abs(towards.x) + abs(towards.y) + towards.z);
    vec2 place = (vec2(p.x + p.y, p.x - p.y) * 0.5 + 0.5) * float(map_size);
    ivec2 texel = min(ivec2(place), map_size - 1);
    int size = map_size;
    vec4 met = maps[(vpl / 3 * map_size + texel.y) * map_size + texel.x];
    if (met.w < 0.0) {
        ivec2 inside = min(ivec2((place - vec2(texel)) * float(map_refinement)), map_refinement - 1);
        met = maps[block_start(-1.0 - met.w) + inside.y * map_refinement + inside.x];
        texel = texel * map_refinement + inside;
        size *= map_refinement;
    }
    float hidden = overlap(frame * map_axis(texel, size) * met.w, met.xyz, offset, normal);
    return 1.0 - clamp((hidden - visibility_bias) / visibility_softness, 0.0, 1.0);
}
#endif
