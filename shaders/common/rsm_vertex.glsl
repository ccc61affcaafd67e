// A vertex of the scene as a light face sees it: the whole vertex shader. Depth is reversed: 1 at the near plane, 0 at
// infinity or, for an orthographic face, at its range.
//
// Reads: the scene's vertices and instances, light faces. Output: position, normal, uv and base colour in world space.
#include "common/scene_vertex.glsl"
#include "common/lights.glsl"

uniform int face_index;

out vec3 position_world;
out vec3 normal_world;
out vec2 uv;
out vec3 base_color;
#ifdef HAS_ALPHA
flat out vec4 alpha;
#endif

void main() {
    SceneVertex vertex = scene_vertex();
    position_world = vertex.position_world;
    normal_world = vertex.normal_world;
    base_color = vertex.base_color;
    uv = in_uv;
#ifdef HAS_ALPHA
    alpha = scene_instances[in_instance].alpha;
#endif
    RsmFace face = rsm_faces[face_index];
    vec3 position_face = world_to_face(face, position_world);
    gl_Position = face.orthographic != 0
        ? vec4(position_face.xy / face.extent, 1.0 + position_face.z / face.near_or_range, 1.0)
        : vec4(position_face.xy / face.extent, face.near_or_range, -position_face.z);
}
