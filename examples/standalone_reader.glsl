// The shaders of standalone_reader.py. SURFACES (VERTEX and FRAGMENT) draws the surfaces that a camera or a light sees.
// LIGHTING adds up, at every pixel, the virtual point lights (VPLs) and the lights with their shadows.

const float PI = 3.14159265358979;

struct Light {
    vec4 position_kind;        // world position; 0 spot, 1 point, 2 directional
    vec4 direction_scale;      // unit direction of travel; 1 / (cos inner - cos outer)
    vec4 intensity_cos_outer;  // W/sr (directional: W/m²); cosine of the outer half angle
    vec4 inverse_range;        // 1 / range, 0 where the light does not end; 0, 0, 0
};
layout(std430, binding = 0) readonly buffer Lights { Light lights[]; };

// Irradiance [W/m²] on a surface that faces the light, without shadow; `towards` is the unit vector to the light.
vec3 arriving(Light light, vec3 position, out vec3 towards) {
    towards = -light.direction_scale.xyz;
    if (light.position_kind.w == 2.0) { return light.intensity_cos_outer.rgb; }
    vec3 offset = light.position_kind.xyz - position;
    towards = normalize(offset);
    float cosine = dot(-towards, light.direction_scale.xyz);
    float cone = clamp((cosine - light.intensity_cos_outer.w) * light.direction_scale.w, 0.0, 1.0);
    float ratio = dot(offset, offset) * light.inverse_range.x * light.inverse_range.x;
    float left = max(1.0 - ratio * ratio, 0.0);
    left *= light.position_kind.w == 0.0 ? cone * cone : 1.0;
    return light.intensity_cos_outer.rgb * left / dot(offset, offset);
}

#ifdef VERTEX
in vec3 in_positions, in_normals, in_base_colors;
in vec2 in_uv;
out vec3 position, normal, base_color;
out vec2 uv;
uniform mat4 to_clip;

void main() {
    position = in_positions;
    normal = in_normals;
    base_color = in_base_colors;
    uv = in_uv;
    gl_Position = to_clip * vec4(position, 1.0);
}
#endif

#ifdef FRAGMENT
in vec3 position, normal, base_color;
in vec2 uv;
layout(location = 0) out vec4 out_position;  // world position; depth along the view axis
layout(location = 1) out vec4 out_normal;    // shading normal; for a light: the triangle's normal, area on the surface
layout(location = 2) out vec4 out_color;     // albedo; for a light: reflected flux [W]
uniform vec4 eye;    // position of the viewer; w = 0: direction towards the viewer
uniform vec4 axis;   // depth = dot(axis, position)
uniform float reach; // the scene's diagonal: scales the depth buffer
uniform int light;   // index of the light whose map this is, or -1 for the camera
uniform float texel; // area of a texel at unit depth; for a directional light, its area
uniform sampler2D image;
uniform ivec2 mirrored;

void main() {
    vec3 to_eye = normalize(eye.xyz - eye.w * position);
    vec3 plane = cross(dFdx(position), dFdy(position));
    plane = dot(plane, plane) > 0.0 ? normalize(plane) : to_eye;
    plane = dot(plane, to_eye) < 0.0 ? -plane : plane;
    vec3 shading = dot(normal, normal) > 0.0 ? normalize(normal) : plane;
    shading = dot(shading, to_eye) < 0.0 ? -shading : shading;
    vec2 folded = mix(uv, 1.0 - abs(mod(uv, 2.0) - 1.0), vec2(mirrored));
    vec3 albedo = clamp(base_color * textureGrad(image, folded, dFdx(uv), dFdy(uv)).rgb, 0.0, 1.0);
    float depth = dot(axis, vec4(position, 1.0));
    out_position = vec4(position, depth);
    out_normal = vec4(shading, 0.0);
    out_color = vec4(albedo, 1.0);
    gl_FragDepth = depth / (depth + reach);
    if (light >= 0) {
        vec3 towards;
        vec3 irradiance = arriving(lights[light], position, towards);
        float cosine = dot(plane, towards);
        // Area across the light's rays: a texel of a perspective map grows with depth squared and is seen at an angle.
        float across = texel * (eye.w > 0.0 ? depth * depth * dot(axis.xyz, -towards) : 1.0);
        // A smooth-shaded surface is lit by its shading normal but has the area of its triangle; 8 bounds their ratio.
        float ratio = min(dot(shading, towards) / max(cosine, 1e-4), 8.0);
        out_normal = vec4(plane, across / max(cosine, 0.02));
        out_color = vec4(irradiance * across * albedo * ratio, 1.0);
    }
}
#endif

#ifdef LIGHTING
layout(local_size_x = 8, local_size_y = 8) in;

struct Face {
    mat4 to_face;
    vec4 extent_light;  // half width and height at unit depth; index of the light; 1 if orthographic
    vec4 origin;        // first texel of its tile in the atlas
};
layout(std430, binding = 1) readonly buffer Faces { Face faces[]; };
layout(binding = 0) uniform sampler2D positions;
layout(binding = 1) uniform sampler2D normals;
layout(binding = 2) uniform sampler2D albedos;
layout(binding = 3) uniform sampler2D light_depths;
layout(rgba32f, binding = 0) writeonly uniform image2D radiance;

// Percentage-closer filtering of the four nearest texels. The bias, 1.5 and 0.5 texels, is the runtime's.
float shadow(int light, vec3 position, vec3 normal, vec3 towards) {
    int chosen = 0;
    float most = -3.0;  // below what any face gives
    for (int i = 0; i < faces.length(); ++i) {
        if (int(faces[i].extent_light.z) != light) continue;
        vec3 place = (faces[i].to_face * vec4(position, 1.0)).xyz;
        // Of a sun's faces, each within the one before, the last that shows the place 3 texels from its border.
        bool shown = all(lessThan(abs(place.xy), faces[i].extent_light.xy * (1.0 - 6.0 / float(face_size))));
        float ahead = faces[i].extent_light.w > 0.0 ? float(shown) - 2.0 : -normalize(place).z;
        if (ahead > most || (shown && faces[i].extent_light.w > 0.0)) { most = ahead; chosen = i; }
    }
    Face face = faces[chosen];
    bool flat_face = face.extent_light.w > 0.0;
    vec2 extent = face.extent_light.xy;
    float depth = -(face.to_face * vec4(position, 1.0)).z;
    float texel = max(extent.x, extent.y) * 2.0 / float(face_size) * (flat_face ? 1.0 : depth);
    float cosine = clamp(dot(normal, towards), 0.0, 1.0);
    vec3 moved = position + normal * (1.5 * sqrt(1.0 - cosine * cosine) * texel);
    vec3 seen = (face.to_face * vec4(moved, 1.0)).xyz;
    vec2 place = (seen.xy / (extent * (flat_face ? 1.0 : -seen.z)) * 0.5 + 0.5) * float(face_size) - 0.5;
    float lit = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 at = ivec2(floor(place)) + ivec2(i & 1, i >> 1);
        vec2 weight = 1.0 - abs(place - vec2(at));
        at = clamp(at, ivec2(0), ivec2(face_size - 1)) + ivec2(face.origin.xy);
        float stored = texelFetch(light_depths, at, 0).r;
        lit += stored > 0.0 && stored < -seen.z - 0.5 * texel ? 0.0 : weight.x * weight.y;
    }
    return lit;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    vec4 place = texelFetch(positions, pixel, 0);
    vec3 p = place.xyz, n = texelFetch(normals, pixel, 0).xyz, irradiance = vec3(0.0);
    for (int i = 0; i < vpls.length(); i += 3) {
        vec3 d = vpls[i].xyz - p, m = vpls[i + 1].xyz;
        float dd = max(dot(d, d), 1e-30), footprint = falloff_footprint * vpls[i].w;
        float form = disc_lights > 0
            ? disc_form(d / scene_length, n, m, footprint / scene_length) / (scene_length * scene_length)
            : max(dot(n, d), 0.0) * max(-dot(m, d), 0.0) / dd / (dd + footprint * footprint);
        form *= exp(-extinction_coefficient * sqrt(dd) / scene_length);
        if (form > 0.0) { irradiance += vpls[i + 2].rgb * (intensity / PI * form * visibility(i, p, n)); }
    }
    for (int i = 0; i < lights.length(); ++i) {
        vec3 towards;
        vec3 full = arriving(lights[i], p, towards);
        float cosine = dot(n, towards);
        if (cosine > 0.0) { irradiance += full * (cosine * shadow(i, p, n, towards)); }
    }
    vec4 albedo = texelFetch(albedos, pixel, 0);
    imageStore(radiance, pixel, vec4(albedo.rgb / PI * irradiance, albedo.a));
}
#endif
