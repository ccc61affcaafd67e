// The scene's vertices, which stand in the world already, seen by a camera or a light face.
layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
layout(location = 3) in vec3 in_base_color;
layout(location = 4) in vec3 in_plane_normal;  // of the triangle: its three corners are its own

uniform mat4 to_clip;  // depth is the fragment's to write: WebGL's own range would waste it

out vec3 position_world;
out vec3 normal_world;
out vec2 uv;
out vec3 base_color;
flat out vec3 plane_point;
flat out vec3 plane_normal;

void main() {
    position_world = in_position;
    normal_world = in_normal;
    uv = in_uv;
    base_color = in_base_color;
    plane_point = in_position;
    plane_normal = in_plane_normal;
    gl_Position = to_clip * vec4(in_position, 1.0);
}
