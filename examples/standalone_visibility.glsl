// The visibility maps of standalone_reader.py: a small map of the surfaces that each VPL's hemisphere sees.
// CASTING sends one ray through each texel, against every triangle, which is short but slow. Where the surface in one
// texel hides that in its neighbour, MARKING replaces the texel by a block of finer ones, and REFINING casts those. Where
// two texels meet in a concave corner, MARKING says so in the last bits of the distance. LIGHTING looks up the map in
// the direction of a pixel. The program defines the config's parameters, scene_length,
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

// Whether a hit lies behind the plane of another one, by more than rounding.
bool is_behind(vec3 end, vec3 other, vec3 plane) {
    return dot(end - other, plane) < -1e-4 * (length(end) + length(other));
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
shared uint marks[map_texels];  // of corners; 8 more at a silhouette

bool hides(ivec2 texel, ivec2 other, int start, mat3 frame) {
    vec4 nearer = maps[start + texel.y * map_size + texel.x], farther = maps[start + other.y * map_size + other.x];
    vec3 end = frame * map_axis(texel, map_size) * nearer.w, hidden = frame * map_axis(other, map_size) * farther.w;
    return farther.w < 1e5 * scene_length && overlap(end, nearer.xyz, hidden, farther.xyz) > 2e-3;
}

bool is_corner(ivec2 texel, ivec2 other, int start, mat3 frame) {
    if (any(notEqual(clamp(other, 0, map_size - 1), other))) { return false; }
    vec4 own = maps[start + texel.y * map_size + texel.x], met = maps[start + other.y * map_size + other.x];
    vec3 end = frame * map_axis(texel, map_size) * own.w, beside = frame * map_axis(other, map_size) * met.w;
    return max(own.w, met.w) < 1e5 * scene_length && dot(own.xyz, met.xyz) < 0.99
        && !is_behind(end, beside, met.xyz) && !is_behind(beside, end, own.xyz);
}

// 1 beside a corner; 2 … 5 beside a vertex of three planes, and which of the texel's own corners is towards it.
uint corner_mark(ivec2 texel, int start, mat3 frame) {
    uint mark = 0u;
    for (int k = 0; k < 4; ++k) {
        ivec2 to = ivec2(2 * (k & 1) - 1, (k & 2) - 1), last = texel;
        for (int i = 1; i < 4; ++i) {
            ivec2 beside = texel + ivec2((i & 1) * to.x, (i >> 1) * to.y);
            if (!is_corner(texel, beside, start, frame)) { continue; }
            mark = last != texel && is_corner(last, beside, start, frame) ? uint(2 + k) : max(mark, 1u);
            last = beside;
        }
    }
    return mark;
}

void main() {
    int vpl = 3 * int(gl_WorkGroupID.x), start = vpl / 3 * map_texels, lane = int(gl_LocalInvocationID.x);
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    for (int i = lane; i < map_texels; i += 64) {
        ivec2 texel = ivec2(i % map_size, i / map_size);
        marks[i] = corner_mark(texel, start, frame);
        for (int k = 0; k < 9; ++k) {
            ivec2 beside = clamp(texel + ivec2(k % 3, k / 3) - 1, ivec2(0), ivec2(map_size - 1));
            bool met = maps[start + i].w < 1e5 * scene_length;
            bool other_met = maps[start + beside.y * map_size + beside.x].w < 1e5 * scene_length;
            bool hidden = hides(texel, beside, start, frame) || hides(beside, texel, start, frame);
            if (met != other_met || hidden) { marks[i] |= 8u; }
        }
    }
    barrier();
    for (int i = lane; i < map_texels; i += 64) {
        uint block = marks[i] >= 8u ? atomicAdd(counted, 1u) : uint(map_blocks);
        float marked = uintBitsToFloat((floatBitsToUint(maps[start + i].w) & ~7u) | (marks[i] & 7u));
        maps[start + i].w = block < uint(map_blocks) ? -1.0 - float(block) : marked;
    }
}
#endif

#ifdef LIGHTING
// A texel of a map: its hit from the map's origin, the hit's plane, the texel's side in finest texels, its corner mark.
struct Texel { vec3 end, plane; int side; uint mark; };

// The texel at a place, which counts finest texels.
Texel texel_at(int vpl, ivec2 place, mat3 frame) {
    ivec2 texel = place / map_refinement, inside = place % map_refinement;
    vec4 met = maps[(vpl / 3 * map_size + texel.y) * map_size + texel.x];
    if (met.w >= 0.0) {
        vec3 end = frame * map_axis(texel, map_size) * met.w;
        return Texel(end, met.xyz, map_refinement, floatBitsToUint(met.w) & 7u);
    }
    met = maps[block_start(-1.0 - met.w) + inside.y * map_refinement + inside.x];
    return Texel(frame * map_axis(place, map_size * map_refinement) * met.w, met.xyz, 1, 1u);
}

// Whether a pixel is on the other side of the sheet that was met, near the hit.
bool shows_its_back(Texel met, vec3 offset, vec3 normal) {
    vec3 between = met.end - offset;
    float apart = length(between), rounding = 1e-4 * (length(met.end) + length(offset));
    return dot(met.plane, normal) < -0.7
        && dot(between, met.plane) > -0.3 * apart - rounding && dot(between, normal) > -0.5 * apart - rounding;
}

// The overlap of a pixel whose tangent plane hides the middle of a disc: both the pixel and the place where that plane
// cuts the disc are behind the surface.
float rim_overlap(Texel met, vec3 offset, vec3 normal, vec3 axis) {
    vec3 flat_normal = normal - axis * dot(normal, axis);
    vec3 cut = flat_normal * (dot(offset, normal) / max(dot(flat_normal, flat_normal), 1e-12));
    return min(dot(met.end - offset, met.plane), dot(met.end - cut, met.plane)) / length(offset);
}

// The overlap of a pixel and a plane that a corner extends to the pixel's direction.
float corner_overlap(Texel met, vec3 offset, vec3 normal, vec3 axis) {
    if (shows_its_back(met, offset, normal)) { return 1.0; }
    if (dot(offset, normal) >= 0.0) { return rim_overlap(met, offset, normal, axis); }
    bool before = dot(met.end - offset, normal) > -1e-4 * length(offset);
    return before ? dot(met.end - offset, met.plane) / length(offset) : -1.0;
}

// Share of a VPL's light that reaches a pixel. The hit of the nearest ray shades it if each is behind the other's
// plane. At a corner, so do the planes of the three rays around it that no hit of the four is behind.
float visibility(int vpl, vec3 position, vec3 normal) {
    if (map_size == 0) { return 1.0; }
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    vec3 offset = position - map_origin(vpl);
    vec3 towards = offset * frame;
    if (towards.z <= 0.0) { return 1.0; }
    int finest = map_size * map_refinement;
    vec2 p = towards.xy / (abs(towards.x) + abs(towards.y) + towards.z);
    vec2 place = min((vec2(p.x + p.y, p.x - p.y) * 0.5 + 0.5) * float(finest), float(finest) - 0.5);
    ivec2 inside = ivec2(place);
    Texel own = texel_at(vpl, inside, frame);
    float hidden = dot(offset, normal) < 0.0
        ? overlap(own.end, own.plane, offset, normal) : rim_overlap(own, offset, normal, frame[2]);
    hidden = shows_its_back(own, offset, normal) ? 1.0 : hidden;
    if (own.mark > 0u) {
        ivec2 start = inside / own.side * own.side;
        uint vertex = own.mark - 2u;
        bvec2 beyond = own.mark == 1u ? greaterThanEqual(2.0 * place, vec2(2 * start + own.side))
            : bvec2((vertex & 1u) != 0u, (vertex & 2u) != 0u);
        ivec2 beside = start + ivec2(beyond.x ? own.side : -1, beyond.y ? own.side : -1);
        Texel met[4] = Texel[4](own, own, own, own);
        for (int i = 1; i < 4; ++i) {
            ivec2 around = ivec2((i & 1) != 0 ? beside.x : inside.x, (i & 2) != 0 ? beside.y : inside.y);
            if (clamp(around, 0, finest - 1) == around) { met[i] = texel_at(vpl, around, frame); }
        }
        for (int i = 0; i < 4; ++i) {
            bool counts = !is_behind(met[i].end, own.end, own.plane);
            for (int j = 0; j < 4; ++j) { counts = counts && !is_behind(met[j].end, met[i].end, met[i].plane); }
            if (counts) { hidden = max(hidden, corner_overlap(met[i], offset, normal, frame[2])); }
        }
    }
    return 1.0 - clamp((hidden - visibility_bias) / visibility_softness, 0.0, 1.0);
}
#endif
