// Punctual lights (spot, point, directional) and the faces of their reflective shadow maps (RSM).
//
// Provides: PI, `lights`, `rsm_faces`, the light that arrives at a point without shadow, and `shown_finer`.
// Constants: LIGHT_COUNT and RSM_FACE_COUNT, in the web page only (renderer/export/web_page/web_page.py).
// Python: renderer/scene/light_faces.py, which also owns the byte layout of both structs.

// Kinds of light: KIND_CODES of renderer/scene/light_faces.py.
#define LIGHT_SPOT 0
#define LIGHT_POINT 1
#define LIGHT_DIRECTIONAL 2

const float PI = 3.14159265358979;

struct Light {
    vec4 position_kind;         // world position (not used by directional lights); kind
    vec4 direction_cone_scale;  // unit direction of travel; spot: 1 / (cos inner - cos outer)
    vec4 intensity_cos_outer;   // W/sr (directional: W/m² on a surface square to the beam); spot: cos outer
    ivec2 faces;                // first face, number of faces
    float inverse_range;        // 1 / range [1 / world units]; 0 where the light does not end
    float padding;
};

// One view of a light, drawn into one tile of the RSM atlas. A perspective face covers |xy| <= extent at unit depth. An
// orthographic face covers |xy| <= extent in world units and depths in [0, range].
struct RsmFace {
    mat4 light_to_world;  // rigid; the face looks along -Z
    vec2 extent;
    float near_or_range;  // perspective: near plane; orthographic: range
    int light;            // index of its light
    int orthographic;     // 1 or 0
#ifndef LIGHT_COUNT
    int padding[3];
#endif
};

#ifdef LIGHT_COUNT  // WebGL has no storage buffers: uniform blocks. std140 pads a face to the same 96 bytes.
layout(std140) uniform Lights {
    Light lights[LIGHT_COUNT];
};

layout(std140) uniform RsmFaces {
    RsmFace rsm_faces[RSM_FACE_COUNT];
};
#else
layout(std430, binding = LIGHTS_BINDING) readonly buffer Lights {
    Light lights[];
};

layout(std430, binding = RSM_FACES_BINDING) readonly buffer RsmFaces {
    RsmFace rsm_faces[];
};
#endif

// The spot's cone in [0, 1], 1 for other kinds (KHR_lights_punctual, "Inner and Outer Cone Angles").
float cone_falloff(Light light, vec3 direction_from_light) {
    if (int(light.position_kind.w) != LIGHT_SPOT) {
        return 1.0;
    }
    float cosine = dot(direction_from_light, light.direction_cone_scale.xyz);
    float ramp = clamp((cosine - light.intensity_cos_outer.w) * light.direction_cone_scale.w, 0.0, 1.0);
    return ramp * ramp;
}

// Share of the light that is left at a distance: 1 - (d / range)⁴, 0 beyond the range, 1 without one
// (KHR_lights_punctual, "Range Property").
float range_falloff(Light light, float distance_squared) {
    if (light.inverse_range == 0.0) {
        return 1.0;
    }
    float ratio = distance_squared * light.inverse_range * light.inverse_range;
    return max(1.0 - ratio * ratio, 0.0);
}

// Unit vector from a point towards the light.
vec3 towards_light(Light light, vec3 position_world) {
    if (int(light.position_kind.w) == LIGHT_DIRECTIONAL) {
        return -light.direction_cone_scale.xyz;
    }
    return normalize(light.position_kind.xyz - position_world);
}

// Irradiance [W/m²] on a surface that faces the light, without shadow.
vec3 irradiance_facing(Light light, vec3 position_world) {
    if (int(light.position_kind.w) == LIGHT_DIRECTIONAL) {
        return light.intensity_cos_outer.rgb;
    }
    vec3 from_light = position_world - light.position_kind.xyz;
    float distance_squared = max(dot(from_light, from_light), 1e-30);
    return light.intensity_cos_outer.rgb * cone_falloff(light, from_light * inversesqrt(distance_squared))
         * range_falloff(light, distance_squared) / distance_squared;
}

// A world position in the face's own space.
vec3 world_to_face(RsmFace face, vec3 position_world) {
    return transpose(mat3(face.light_to_world)) * (position_world - face.light_to_world[3].xyz);
}

// Whether a finer face of the same light shows a position. The faces of a directional light are nested, each in the one
// before it (renderer/scene/sun_faces.py); the finest that shows a surface carries its flux, the others none.
bool shown_finer(int face_index, vec3 position_world) {
    ivec2 faces = lights[rsm_faces[face_index].light].faces;
    if (rsm_faces[face_index].orthographic == 0 || face_index + 1 >= faces.x + faces.y) {
        return false;
    }
    RsmFace finer = rsm_faces[face_index + 1];
    return all(lessThan(abs(world_to_face(finer, position_world).xy), finer.extent));
}
