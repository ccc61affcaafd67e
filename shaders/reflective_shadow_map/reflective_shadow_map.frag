// RSM: geometric normal and reflectance towards the scene; flux comes back from the light's intensity, so
// that both targets hold plain ratios and half floats serve every scale.
#include "common/lights.glsl"
#include "common/octahedral.glsl"
#include "common/surface.glsl"

uniform int face_index;

layout(location = 0) out vec2 out_normal;
layout(location = 1) out vec4 out_reflectance;

// A smooth surface is lit by its shading normal but has the area of its true plane; near a silhouette
// their ratio runs away while the texel covers almost nothing.
const float MAX_COSINE_RATIO = 8.0;

void main() {
    Light light = lights[rsm_faces[face_index].light];
    vec3 to_light = towards_light(light, position_world);
    vec3 normal_geometric = geometric_normal(to_light);
    float cosine_shading = dot(shading_normal(to_light, normal_geometric), to_light);
    float cosine_geometric = max(dot(normal_geometric, to_light), 1e-4);
    out_normal = octahedral_encode(normal_geometric);
    out_reflectance = vec4(surface_albedo() * cone_falloff(light, -to_light)
                           * min(cosine_shading / cosine_geometric, MAX_COSINE_RATIO), 1.0);
}
