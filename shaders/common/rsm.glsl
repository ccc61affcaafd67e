// Reads the reflective shadow map (RSM). The atlas holds one square tile for each light face, column by column and row
// by row.
//
// Provides: `rsm_texel`, `rsm_position_on_plane`, and `mean_flux` of common/mean_flux.glsl. Texture depth is reversed, 0
// where nothing was drawn.
// Constants: RSM_RESOLUTION, texels along the side of a tile.
// Python: `ReflectiveShadowMap` in renderer/gpu/render_targets.py. A numpy version of `rsm_texel`:
// renderer/techniques/vpls_readback.py. Source: Dachsbacher and Stamminger 2005.
#include "common/lights.glsl"
#include "common/mean_flux.glsl"
#include "common/octahedral.glsl"

uniform sampler2D rsm_depth;
uniform sampler2D rsm_normal;
uniform sampler2D rsm_reflectance;
uniform int rsm_columns;
uniform int rsm_face_count;

// The piece of surface that a light sees in one texel.
struct RsmTexel {
    vec3 flux;            // radiant flux that it reflects [W]; 0 where unlit
    vec3 position_world;
    vec3 normal_world;    // geometric normal on the lit side, unit
    float area;           // area on the surface [world units²]
};

// A choice. It bounds the area of a texel at grazing incidence: at most 50 times what a facing surface would have.
const float RSM_MIN_COSINE = 0.02;

// The lowest texel of a face's tile.
ivec2 rsm_tile_origin(int face_index) {
    return ivec2(face_index % rsm_columns, face_index / rsm_columns) * RSM_RESOLUTION;
}

// Distance along the face's axis [world units] from the stored, reversed depth.
float rsm_view_depth(RsmFace face, float depth) {
    return face.orthographic != 0 ? (1.0 - depth) * face.near_or_range : face.near_or_range / depth;
}

// The surface in a texel of the atlas. Flux = intensity · solid angle · reflectance, or for a directional light
// irradiance · area across the beam · reflectance.
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

    float flux_factor;  // solid angle of the texel [sr], or its area across the beam [world units²]
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

// Where the light's ray through `place`, a point of the atlas in texels, meets the plane of the surface in `texel`; the
// texel's own position where ray and plane are nearly parallel.
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
