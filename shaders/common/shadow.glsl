// Shadows of the punctual lights, looked up in their RSMs.
//
// Provides: `shadow`. Needs common/gbuffer.glsl and common/rsm.glsl. With HAS_BLENDED, the scene has surfaces that let a
// share of the light pass. The RSM then shows them in some texels, and shadows have maps of their own.

#ifdef HAS_BLENDED
uniform sampler2D shadow_depth;    // of what stops all light, as the RSM's
uniform sampler2D shadow_passing;  // depth of the last blended surface before that, and the share that passes them all
#endif

// Choices. The bias is in RSM texels, so it does not depend on scale or resolution. The receiver moves along its normal
// by NORMAL_BIAS texels times the sine of the angle of incidence; a blocker must lie DEPTH_BIAS texels in front of it.
const float NORMAL_BIAS = 1.5;
const float DEPTH_BIAS = 0.5;

// A choice: a face is used up to this many texels from its border. A receiver moves by up to 1.5, and the filter looks
// one further.
const float BORDER = 3.0;

// The light's face that looks towards a position most directly; of nested ones, the finest that shows it.
int face_towards(Light light, vec3 position_world) {
    int best = light.faces.x;
    float best_depth = -1.0;
    for (int i = light.faces.x; i < light.faces.x + light.faces.y; ++i) {
        vec3 position_face = world_to_face(rsm_faces[i], position_world);
        if (rsm_faces[i].orthographic != 0) {
            vec2 reach = rsm_faces[i].extent * (1.0 - 2.0 * BORDER / float(RSM_RESOLUTION));
            if (all(lessThan(abs(position_face.xy), reach))) { best = i; }
            continue;
        }
        float depth = -normalize(position_face).z;
        if (depth > best_depth) { best_depth = depth; best = i; }
    }
    return best;
}

// Share of the light that arrives, in [0, 1]: percentage-closer filtering (Reeves et al. 1987) over the four nearest
// texels.
float shadow(Light light, Receiver receiver, vec3 to_light) {
    int face_index = face_towards(light, receiver.position_world);
    RsmFace face = rsm_faces[face_index];
    float depth = -world_to_face(face, receiver.position_world).z;
    float texel_size = max(face.extent.x, face.extent.y) * (2.0 / float(RSM_RESOLUTION)) * (face.orthographic != 0 ? 1.0 : depth);
    float cosine = clamp(dot(receiver.normal_world, to_light), 0.0, 1.0);
    float sine = sqrt(1.0 - cosine * cosine);
    vec3 moved = receiver.position_world + receiver.normal_world * (NORMAL_BIAS * sine * texel_size);
    vec3 position_face = world_to_face(face, moved);
    float moved_depth = -position_face.z - DEPTH_BIAS * texel_size;
    vec2 ndc = position_face.xy / (face.extent * (face.orthographic != 0 ? 1.0 : -position_face.z));
    vec2 texel = (ndc * 0.5 + 0.5) * float(RSM_RESOLUTION) - 0.5;
    ivec2 corner = ivec2(floor(texel));
    vec2 blend = texel - vec2(corner);
    ivec2 origin = rsm_tile_origin(face_index);
    float lit[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 at = clamp(corner + ivec2(i & 1, i >> 1), ivec2(0), ivec2(RSM_RESOLUTION - 1));
#ifdef HAS_BLENDED
        float stored = texelFetch(shadow_depth, origin + at, 0).r;
        vec4 passing = texelFetch(shadow_passing, origin + at, 0);
        float before = passing.a < 1.0 && rsm_view_depth(face, passing.r) < moved_depth ? passing.a : 1.0;
#else
        float stored = texelFetch(rsm_depth, origin + at, 0).r;
        const float before = 1.0;
#endif
        lit[i] = stored > 0.0 && rsm_view_depth(face, stored) < moved_depth ? 0.0 : before;
    }
    return mix(mix(lit[0], lit[1], blend.x), mix(lit[2], lit[3], blend.x), blend.y);
}
