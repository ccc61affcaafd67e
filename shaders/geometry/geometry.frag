// Geometry pass: writes the G-buffer's shading normal (octahedral) and albedo, and in scenes with glowing surfaces the
// emitted radiance. Positions are rebuilt from depth.
//
// Reads: the outputs of geometry.vert, the base colour and emission textures. Constants: GLOWS, 0 or 1. Python: renderer/frame/passes/geometry.py.
#include "common/octahedral.glsl"
#include "common/surface.glsl"
#ifdef HAS_ALPHA
#include "common/surface_alpha.glsl"
#endif

uniform vec3 eye_world;

layout(location = 0) out vec2 out_normal;
layout(location = 1) out vec4 out_albedo;
#if GLOWS
layout(location = 2) out vec4 out_emission;

uniform sampler2D emission_texture;
uniform ivec2 emission_mirrored;
flat in vec4 emission;

// Emitted radiance [W/(m² sr)] towards the eye.
vec3 surface_emission() {
    vec2 folded = 1.0 - abs(mod(uv, 2.0) - 1.0);
    vec2 place = mix(uv, folded, vec2(emission_mirrored));
    vec3 texel = textureGrad(emission_texture, place, dFdx(uv), dFdy(uv)).rgb;
    return gl_FrontFacing || emission.w > 0.0 ? emission.rgb * texel : vec3(0.0);
}
#endif

void main() {
#ifdef HAS_ALPHA
    if (!is_seen()) {
        discard;
    }
#endif
    vec3 to_eye = eye_world - position_world;
    out_normal = octahedral_encode(shading_normal(to_eye, geometric_normal(to_eye)));
    out_albedo = vec4(surface_albedo(), 1.0);
#if GLOWS
    out_emission = vec4(surface_emission(), 1.0);
#endif
}
