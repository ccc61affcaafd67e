// Screen-space indirect, part 1: for every pixel, its radiosity from direct light and the squared footprint that a VPL
// drawn on its surface has.
//
// Reads: G-buffer, direct irradiance, light accumulation, lights, frame statistics, importance factors.
// Writes: emitters. Dynamic lights are subtracted, because they have no VPLs.
// Python: renderer/frame/passes/screen_space_indirect.py.
//
// One draw takes RSM texel i, of area A_i and reflected flux Φ_i, with probability p_i = Φ_i^γ F_i / W, where
// W = Σ Φ_i^γ F_i and F_i is the importance factor. Its VPL stands for the area
//     A = A_i / (N p_i) = A_i W / (N Φ_i^γ F_i).
// For radiosity B, Φ_i = B A_i, and so
//     A = A_i^(1-γ) W / (N B^γ F_i),    l² = A / π.
// For γ = 1 without importance, all VPLs have the same flux and the texel's area drops out: A = Φ_total / (N B).
// Where several lights reach a point, each light has its own VPLs there, with footprints wider than this l. The near
// field then returns less than the VPLs withhold, never more.
#include "common/artist_parameters.glsl"
#include "common/gbuffer.glsl"
#include "common/rsm.glsl"
#include "common/vpl_importance.glsl"
#include "common/scene_length.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D gbuffer_albedo;
uniform sampler2D direct_irradiance;
uniform sampler2D light_accumulation;  // dynamic lights have no VPLs, and so lose nothing
uniform float accumulation_unit;       // irradiance [W/m²] of a stored 1; 0 where there is none
uniform int vpl_count;
uniform int light_count;

layout(rgba32f, binding = EMITTERS_IMAGE) writeonly uniform image2D out_emitters;  // radiosity [W/m²], l² [world units²]

struct SeeingTexel {
    float area;        // on the surface [world units²]
    float importance;  // F
};

// The RSM texel that sees a surface, of the light that gives it the most irradiance without shadows.
SeeingTexel rsm_texel_seeing(Receiver receiver) {
    float most = 0.0;
    SeeingTexel result = SeeingTexel(0.0, 1.0);
    for (int i = 0; i < light_count; ++i) {
        Light light = lights[i];
        vec3 to_light = towards_light(light, receiver.position_world);
        float cosine = dot(receiver.normal_world, to_light);
        float arriving = mean_flux(irradiance_facing(light, receiver.position_world)) * cosine;
        if (!(arriving > most)) {
            continue;
        }
        for (int f = light.faces.x; f < light.faces.x + light.faces.y; ++f) {
            RsmFace face = rsm_faces[f];
            vec3 position_face = world_to_face(face, receiver.position_world);
            float depth = face.orthographic != 0 ? 1.0 : -position_face.z;
            if (depth > 0.0 && all(lessThanEqual(abs(position_face.xy), face.extent * depth))) {
                vec2 side = face.extent * (2.0 * depth / RSM_RESOLUTION);
                float tilt = face.orthographic != 0 ? 1.0 : depth / length(position_face);
                most = arriving;
                vec2 place = (position_face.xy / (face.extent * depth) * 0.5 + 0.5) * RSM_RESOLUTION;
                result.area = side.x * side.y * tilt / max(cosine, RSM_MIN_COSINE);
                result.importance = artist.density_importance > 0.0
                    ? importance_factor(f, min(ivec2(place), ivec2(RSM_RESOLUTION - 1))) : 1.0;
            }
        }
    }
    return result;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_emitters)))) {
        return;
    }
    vec3 irradiance = texelFetch(direct_irradiance, pixel, 0).rgb;
    if (accumulation_unit > 0.0) {
        // As in direct_light.comp: 65504 is the largest half float.
        vec3 dynamic = accumulation_unit * min(texelFetch(light_accumulation, pixel, 0).rgb, 65504.0);
        irradiance = max(irradiance - dynamic, 0.0);
    }
    vec3 radiosity = texelFetch(gbuffer_albedo, pixel, 0).rgb * irradiance;
    float level = mean_flux(radiosity);
    float area = 0.0;
    if (level > 0.0) {
        area = total_weight / (float(vpl_count) * pow(level, artist.density_exponent));
        if (artist.density_exponent < 1.0 || artist.density_importance > 0.0) {
            SeeingTexel texel = rsm_texel_seeing(gbuffer_receiver(pixel));
            area /= texel.importance;
            // pow(0, 0) is undefined: where no texel was found, the area is 0.
            area *= artist.density_exponent < 1.0 ? pow(texel.area, 1.0 - artist.density_exponent) : 1.0;
        }
    }
    imageStore(out_emitters, pixel, vec4(radiosity, area / PI));
}
