// Geometry pass: the scene from the camera.
//
// Reads: the scene's vertices and instances. Output: position, normal, uv and base colour in world space.
// Python: renderer/frame/passes/geometry.py.
#include "common/scene_vertex.glsl"

uniform mat4 world_to_camera;
uniform vec2 tan_half_fov;
uniform float near_plane;

out vec3 position_world;
out vec3 normal_world;
out vec2 uv;
out vec3 base_color;
#ifdef HAS_ALPHA
flat out vec4 alpha;
#endif
#if GLOWS
flat out vec4 emission;  // radiance [W/(m² sr)]; 1 if both sides emit
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
#if GLOWS
    emission = scene_instances[in_instance].emission;
#endif
    vec3 position_camera = (world_to_camera * vec4(position_world, 1.0)).xyz;
    // Reversed depth without a far plane: depth = near_plane / distance along the view axis.
    gl_Position = vec4(position_camera.xy / tan_half_fov, near_plane, -position_camera.z);
}
