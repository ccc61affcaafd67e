// The G-buffer, with its reversed depth in a colour target too: WebGL reads no depth buffer as floats.
#define main surface_main
#include "geometry.frag"
#undef main
#include "web/rounded_normal.glsl"

uniform mat4 world_to_camera;
uniform float near_plane;

layout(location = 2) out float out_depth;

void main() {
    surface_main();
    out_normal = rounded_normal(out_normal);
    out_depth = near_plane / -(world_to_camera * vec4(position_world, 1.0)).z;
    gl_FragDepth = out_depth;
}
