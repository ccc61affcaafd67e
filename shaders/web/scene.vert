// Web page: the scene's vertices, already in world space, seen by the camera or by a light face.
//
// Output: position, normal, uv and base colour in world space; one point and the normal of the triangle's plane.
// Runtime: geometry/geometry.vert and reflective_shadow_map/reflective_shadow_map.vert.
layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
layout(location = 3) in vec3 in_base_color;
layout(location = 4) in vec3 in_plane_normal;  // of the triangle; no vertex is shared between triangles

uniform mat4 to_clip;  // without depth: the fragment shader writes it, since WebGL's range [-1, 1] would lose precision

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
