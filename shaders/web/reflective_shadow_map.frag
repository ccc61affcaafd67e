// One face of the RSM, with its reversed depth in a colour target too.
#define main surface_main
#include "reflective_shadow_map.frag"
#undef main
#include "web/rounded_normal.glsl"

layout(location = 2) out float out_depth;

void main() {
    surface_main();
    out_normal = rounded_normal(out_normal);
    RsmFace face = rsm_faces[face_index];
    float along = world_to_face(face, position_world).z;
    out_depth = face.orthographic != 0 ? 1.0 + along / face.near_or_range : face.near_or_range / -along;
    gl_FragDepth = out_depth;
}
