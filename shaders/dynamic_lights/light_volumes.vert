// Light volumes: one instance of a proxy mesh for each dynamic light, just large enough to enclose what it reaches.
//
// Reads: dynamic lights. Output: `light_index`.
// Constants: CONE (1 for spots), AZIMUTH_COSINE and CIRCUMSCRIBED of renderer/frame/passes/light_volumes.py.
// Python: renderer/frame/passes/light_volumes.py. Source: Engel 2008 ("Light Pre-Pass").
#include "common/dynamic_lights.glsl"

// Point lights: a direction times the radius of the circumscribed mesh, in ranges. Spots (CONE): share of the polar
// angle, or -1 at the apex; cosine and sine of the azimuth.
in vec3 in_position;

uniform int first_light;
uniform mat4 world_to_camera;
uniform vec2 tan_half_fov;
uniform float near_plane;

flat out int light_index;

#if CONE
// Columns: two unit vectors at right angles to the unit vector n, and n (Duff et al. 2017, "Building an Orthonormal
// Basis, Revisited").
mat3 basis_around(vec3 n) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

vec3 proxy_vertex(DynamicLight light) {
    float cos_outer = max(light.intensity_cos_outer.w, 0.0);
    // The outermost ring makes a pyramid around the cone: its edges lie further out, so that its faces touch the cone.
    float angle = atan(sqrt(1.0 - cos_outer * cos_outer), cos_outer * AZIMUTH_COSINE);
    float polar = max(in_position.x, 0.0) * angle;
    float reach = in_position.x < 0.0 ? 0.0 : CIRCUMSCRIBED;
    return basis_around(light.direction_cone_scale.xyz) * vec3(sin(polar) * in_position.yz, cos(polar)) * reach;
}
#else
vec3 proxy_vertex(DynamicLight light) {
    return in_position;
}
#endif

void main() {
    light_index = first_light + gl_InstanceID;
    DynamicLight light = dynamic_lights[light_index];
    vec3 position_world = light.position_range.xyz + proxy_vertex(light) * light.position_range.w;
    vec3 position_camera = (world_to_camera * vec4(position_world, 1.0)).xyz;
    gl_Position = vec4(position_camera.xy / tan_half_fov, near_plane, -position_camera.z);
}
