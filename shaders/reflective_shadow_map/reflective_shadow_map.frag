// Reflective shadow map: the surfaces that a light face sees, as geometric normal and reflectance.
//
// Reads: the outputs of reflective_shadow_map.vert, the base colour texture, lights.
// Writes: octahedral normal; reflectance = albedo · cone · range falloff · cosine ratio, 0 where a finer face carries
// the flux. The reader multiplies by the light's intensity (common/rsm.glsl), so both targets hold plain ratios, and
// half floats suffice at every scale of the scene.
// Python: renderer/frame/passes/reflective_shadow_map.py.
#include "common/lights.glsl"
#include "common/octahedral.glsl"
#include "common/surface.glsl"
#ifdef HAS_ALPHA
#include "common/surface_alpha.glsl"
#endif

uniform int face_index;

layout(location = 0) out vec2 out_normal;
layout(location = 1) out vec4 out_reflectance;

// A choice. A smooth-shaded surface is lit by its shading normal but has the area of its triangle's plane. Near a
// silhouette the ratio of the two cosines has no bound, while the texel covers almost no area.
const float MAX_COSINE_RATIO = 8.0;

void main() {
#ifdef HAS_ALPHA
    if (!stops_light_of_texel(ivec2(gl_FragCoord.xy))) {
        discard;
    }
#endif
    Light light = lights[rsm_faces[face_index].light];
    vec3 to_light = towards_light(light, position_world);
    vec3 normal_geometric = geometric_normal(to_light);
    float cosine_shading = dot(shading_normal(to_light, normal_geometric), to_light);
    float cosine_geometric = max(dot(normal_geometric, to_light), 1e-4);  // 1e-4 is a choice: avoids 1/0
    out_normal = octahedral_encode(normal_geometric);
    float share = shown_finer(face_index, position_world) ? 0.0 : cone_falloff(light, -to_light);
    vec3 from_light = position_world - light.position_kind.xyz;
    share *= range_falloff(light, dot(from_light, from_light));
    out_reflectance = vec4(
        surface_albedo() * share * min(cosine_shading / cosine_geometric, MAX_COSINE_RATIO), 1.0);
}
