// One face of the RSM, with its reversed depth in a colour target too.
#define main surface_main
#include "reflective_shadow_map/reflective_shadow_map.frag"
#undef main
#include "web/plane_depth.glsl"
#include "web/rounded_normal.glsl"

uniform vec2 tile_origin;

layout(location = 2) out float out_depth;

void main() {
    surface_main();
    out_normal = rounded_normal(out_normal);
    RsmFace face = rsm_faces[face_index];
    float interpolated = -world_to_face(face, position_world).z;
    vec2 ndc = (gl_FragCoord.xy - tile_origin) * (2.0 / float(RSM_RESOLUTION)) - 1.0;
    vec3 start = face.light_to_world[3].xyz;
    vec3 across = mat3(face.light_to_world) * vec3(ndc * face.extent, 0.0);
    vec3 ray = -face.light_to_world[2].xyz;
    if (face.orthographic != 0) {
        out_depth = 1.0 - plane_distance(start + across, ray, interpolated) / face.near_or_range;
    } else {
        out_depth = face.near_or_range / plane_distance(start, ray + across, interpolated);
    }
    gl_FragDepth = out_depth;
}
