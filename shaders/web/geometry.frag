// The G-buffer, with its reversed depth in a colour target too: WebGL reads no depth buffer as floats.
#define main surface_main
#include "geometry/geometry.frag"
#undef main
#include "web/plane_depth.glsl"
#include "web/rounded_normal.glsl"

uniform mat4 world_to_camera;
uniform mat4 camera_to_world;
uniform vec2 tan_half_fov;
uniform vec2 image_size;
uniform float near_plane;

layout(location = 2) out float out_depth;

void main() {
    surface_main();
    out_normal = rounded_normal(out_normal);
    vec2 ndc = gl_FragCoord.xy / image_size * 2.0 - 1.0;
    vec3 ray = mat3(camera_to_world) * vec3(ndc * tan_half_fov, -1.0);
    float interpolated = -(world_to_camera * vec4(position_world, 1.0)).z;
    out_depth = near_plane / plane_distance(eye_world, ray, interpolated);
    gl_FragDepth = out_depth;
}
