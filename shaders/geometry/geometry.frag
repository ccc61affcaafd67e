// Geometry pass: writes the G-buffer's shading normal (octahedral) and albedo. Positions are rebuilt from depth.
//
// Reads: the outputs of geometry.vert, the base colour texture. Python: renderer/frame/passes/geometry.py.
#include "common/octahedral.glsl"
#include "common/surface.glsl"
#ifdef HAS_ALPHA
#include "common/surface_alpha.glsl"
#endif

uniform vec3 eye_world;

layout(location = 0) out vec2 out_normal;
layout(location = 1) out vec4 out_albedo;

void main() {
#ifdef HAS_ALPHA
    if (!is_seen()) {
        discard;
    }
#endif
    vec3 to_eye = eye_world - position_world;
    out_normal = octahedral_encode(shading_normal(to_eye, geometric_normal(to_eye)));
    out_albedo = vec4(surface_albedo(), 1.0);
}
