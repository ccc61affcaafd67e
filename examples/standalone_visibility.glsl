// The visibility maps of standalone_reader.py. CASTING sends rays from every VPL, one through each texel of a small
// map of its hemisphere, against every triangle: short, not fast. LIGHTING asks the map what the VPL sees on the way
// to a pixel. The program defines the config's parameters, scene_length, and map_size: texels along the side, or 0.

#if defined(CASTING) || defined(LIGHTING)
layout(std430, binding = 4) readonly buffer Vpls { vec4 vpls[]; };  // position, footprint; normal; flux
layout(std430, binding = 5) buffer Maps { vec4 maps[]; };           // what a ray met: normal, distance

// Rays start clear of the VPL's own surface.
vec3 map_origin(int vpl) {
    return vpls[vpl].xyz + vpls[vpl + 1].xyz * max(0.01 * vpls[vpl].w, 1e-3 * scene_length);
}

// Tangents, and the normal (Duff et al. 2017).
mat3 map_frame(vec3 n) {
    float s = n.z >= -0.5 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z), b = n.x * n.y * a;
    return mat3(1.0 + s * n.x * n.x * a, s * b, -s * n.x, b, s + n.y * n.y * a, -n.y, n);
}

// Unit vectors of the hemisphere on the square [-1, 1]² (Cigolle et al. 2014, "hemi-oct").
vec3 map_axis(ivec2 texel) {
    vec2 place = (vec2(texel) + 0.5) * (2.0 / float(map_size)) - 1.0;
    vec2 p = vec2(place.x + place.y, place.x - place.y) * 0.5;
    return normalize(vec3(p, 1.0 - abs(p.x) - abs(p.y)));
}
#endif

#ifdef CASTING
layout(local_size_x = 64) in;
layout(std430, binding = 2) readonly buffer Positions { float positions[]; };
layout(std430, binding = 3) readonly buffer Triangles { uint triangles[]; };

vec3 corner(int i) {
    uint first = 3u * triangles[i];
    return vec3(positions[first], positions[first + 1u], positions[first + 2u]);
}

vec4 met_by(vec3 origin, vec3 ray) {
    // A ray that meets nothing ends far outside, at a wall that faces it: no pixel is behind it.
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

void main() {
    int vpl = 3 * int(gl_WorkGroupID.x);
    vec3 origin = map_origin(vpl);
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    for (int texel = int(gl_LocalInvocationID.x); texel < map_size * map_size; texel += 64) {
        vec3 ray = frame * map_axis(ivec2(texel % map_size, texel / map_size));
        maps[vpl / 3 * map_size * map_size + texel] = met_by(origin, ray);
    }
}
#endif

#ifdef LIGHTING
// What the ray nearest to the pixel's direction met shades it if each is behind the other's plane.
float visibility(int vpl, vec3 position, vec3 normal) {
    if (map_size == 0) { return 1.0; }
    mat3 frame = map_frame(vpls[vpl + 1].xyz);
    vec3 offset = position - map_origin(vpl);
    vec3 towards = offset * frame;
    if (towards.z <= 0.0 || dot(offset, normal) >= 0.0) { return 1.0; }
    vec2 p = towards.xy / (abs(towards.x) + abs(towards.y) + towards.z);
    ivec2 texel = min(ivec2((vec2(p.x + p.y, p.x - p.y) * 0.5 + 0.5) * float(map_size)), map_size - 1);
    vec4 met = maps[(vpl / 3 * map_size + texel.y) * map_size + texel.x];
    vec3 past = frame * map_axis(texel) * met.w - offset;
    float overlap = min(dot(past, normal), dot(past, met.xyz)) / length(offset);
    return 1.0 - clamp((overlap - visibility_bias) / visibility_softness, 0.0, 1.0);
}
#endif
