// Reads the G-buffer: the surface that the camera sees at a pixel. Row 0 of the textures is the bottom of the image.
//
// Provides: `gbuffer_receiver`. Python: `GBuffer` in renderer/gpu/render_targets.py, renderer/gpu/camera_uniforms.py.
#include "common/octahedral.glsl"

uniform sampler2D gbuffer_depth;
uniform sampler2D gbuffer_normal;

uniform mat4 camera_to_world;
uniform vec2 tan_half_fov;
uniform float near_plane;

// A surface point that receives light.
struct Receiver {
    bool valid;  // false where the pixel shows no surface
    vec3 position_world;
    vec3 normal_world;  // shading normal, unit
};

// The surface at a pixel. Stored depth is near_plane / distance along the view axis, and 0 where nothing was drawn.
Receiver gbuffer_receiver(ivec2 pixel) {
    Receiver receiver;
    float depth = texelFetch(gbuffer_depth, pixel, 0).r;
    receiver.valid = depth > 0.0;
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(textureSize(gbuffer_depth, 0)) * 2.0 - 1.0;
    float distance_along_axis = near_plane / max(depth, 1e-30);
    vec3 ray = mat3(camera_to_world) * vec3(ndc * tan_half_fov, -1.0);
    receiver.position_world = camera_to_world[3].xyz + ray * distance_along_axis;
    receiver.normal_world = octahedral_decode(texelFetch(gbuffer_normal, pixel, 0).rg);
    return receiver;
}
