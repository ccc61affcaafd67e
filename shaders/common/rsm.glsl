// Reading the RSM atlas: square tiles, one per light face, filled column by column, row by row.
#include "common/lights.glsl"
#include "common/octahedral.glsl"

uniform sampler2D rsm_depth;
uniform sampler2D rsm_normal;
uniform sampler2D rsm_reflectance;
uniform int rsm_columns;
uniform int rsm_face_count;

struct RsmTexel {
    vec3 flux;            // radiant flux reflected by the surface in this texel [W]; 0 where unlit
    vec3 position_world;
    vec3 normal_world;    // geometric, on the lit side
    float area;           // of the surface in this texel [world units²]
};

const float RSM_MIN_COSINE = 0.02; // bounds the area that one texel stands for at grazing incidence: 50 times its own

ivec2 rsm_tile_origin(int face_index) {
    return ivec2(face_index % rsm_columns, face_index / rsm_columns) * RSM_RESOLUTION;
}

float rsm_view_depth(RsmFace face, float depth) {
    return face.orthographic != 0 ? (1.0 - depth) * face.near_or_range : face.near_or_range / depth;
}

RsmTexel rsm_texel(ivec2 texel) {
    RsmTexel result = RsmTexel(vec3(0.0), vec3(0.0), vec3(0.0, 0.0, 1.0), 0.0);
    ivec2 tile = texel / RSM_RESOLUTION;
    int face_index = tile.y * rsm_columns + tile.x;
    float depth = texelFetch(rsm_depth, texel, 0).r;
    if (face_index >= rsm_face_count || !(depth > 0.0)) {
        return result;
    }
    RsmFace face = rsm_faces[face_index];
    Light light = lights[face.light];
    vec2 ndc = (vec2(texel - tile * RSM_RESOLUTION) + 0.5) * (2.0 / float(RSM_RESOLUTION)) - 1.0;
    vec2 side = face.extent * (2.0 / float(RSM_RESOLUTION));
    float view_depth = rsm_view_depth(face, depth);

    float flux_factor; // solid angle, or area across the beam
    vec3 position_face;
    vec3 to_light;
    if (face.orthographic != 0) {
        position_face = vec3(ndc * face.extent, -view_depth);
        to_light = vec3(0.0, 0.0, 1.0);
        flux_factor = side.x * side.y;
        result.area = flux_factor;
    } else {
        vec3 ray = vec3(ndc * face.extent, -1.0);
        float ray_length = length(ray);
        position_face = ray * view_depth;
        to_light = -ray / ray_length;
        flux_factor = side.x * side.y / (ray_length * ray_length * ray_length);
        result.area = flux_factor * dot(position_face, position_face);
    }
    mat3 rotation = mat3(face.light_to_world);
    result.position_world = rotation * position_face + face.light_to_world[3].xyz;
    result.normal_world = octahedral_decode(texelFetch(rsm_normal, texel, 0).rg);
    result.area /= max(dot(result.normal_world, rotation * to_light), RSM_MIN_COSINE);
    result.flux = light.intensity_cos_outer.rgb * texelFetch(rsm_reflectance, texel, 0).rgb * flux_factor;
    return result;
}

// Where the light's ray through a place of the atlas, counted in texels, meets the plane of the surface that
// is seen in a texel beside it; the texel's own place where ray and plane are all but parallel.
vec3 rsm_position_on_plane(RsmTexel texel, vec2 place) {
    ivec2 tile = ivec2(place) / RSM_RESOLUTION;
    RsmFace face = rsm_faces[tile.y * rsm_columns + tile.x];
    mat3 rotation = mat3(face.light_to_world);
    vec2 ndc = (place - vec2(tile * RSM_RESOLUTION)) * (2.0 / float(RSM_RESOLUTION)) - 1.0;
    vec3 across = rotation * vec3(ndc * face.extent, 0.0);
    vec3 start = face.light_to_world[3].xyz;
    vec3 ray = -rotation[2];
    if (face.orthographic != 0) {
        start += across;
    } else {
        ray += across;
    }
    float along = dot(texel.normal_world, ray);
    if (along > -RSM_MIN_COSINE * length(ray)) {
        return texel.position_world;
    }
    return start + ray * (dot(texel.normal_world, texel.position_world - start) / along);
}

// Flux as one number: the mean of the channels, since error counts the same in each of them.
float mean_flux(vec3 flux) {
    return (flux.r + flux.g + flux.b) / 3.0;
}
