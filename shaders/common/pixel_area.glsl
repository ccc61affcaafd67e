// The surface area that one pixel of the G-buffer covers.
//
// Provides: `pixel_area`. Needs common/gbuffer.glsl.

// A choice. It bounds the area at grazing angles: at most 50 times what a surface that faces the eye would have.
const float MIN_EYE_COSINE = 0.02;

// Area [world units²] = a·z²/(n·v): a is the pixel's area at unit depth, z the depth, n the normal, v the ray of unit
// depth from the surface to the eye.
float pixel_area(Receiver surface, ivec2 image_size) {
    vec3 from_eye = surface.position_world - camera_to_world[3].xyz;
    float view_depth = -dot(camera_to_world[2].xyz, from_eye);
    vec3 ray = from_eye / view_depth;
    vec2 side = 2.0 * view_depth * tan_half_fov / vec2(image_size);
    return side.x * side.y / max(-dot(surface.normal_world, ray), MIN_EYE_COSINE * length(ray));
}
