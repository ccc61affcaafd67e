// Shadows of scenes with blended surfaces: first the depth of all that stops light wholly, then, over what lies before
// that, how much passes.
//
// Reads: the outputs of blended_shadow.vert, the base colour texture.
// Writes: depth; then (depth, depth, depth, share that passes), of which the blending keeps the least depth, which is the
// farthest from the light, and the product of the shares.
// Constants: PARTLY, 0 or 1: which of the two. Python: renderer/frame/passes/reflective_shadow_map.py.
#include "common/surface.glsl"
#ifdef HAS_ALPHA
#include "common/surface_alpha.glsl"
#endif

layout(location = 0) out vec4 out_passing;

// Half a step of the texture's eight bits below 1.
const float WHOLE = 1.0 - 0.5 / 255.0;

void main() {
    out_passing = vec4(1.0);
#ifdef HAS_ALPHA
    float opacity = surface_opacity();
    bool partly = is_blended() && opacity < WHOLE;
    if (PARTLY != 0 ? !partly : partly || !is_seen()) {
        discard;
    }
    out_passing = vec4(vec3(gl_FragCoord.z), 1.0 - opacity);
#endif
}
