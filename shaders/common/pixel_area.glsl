// The area of a surface that one pixel of the G-buffer stands for. Needs common/gbuffer.glsl.

const float MIN_EYE_COSINE = 0.02; // bounds it at grazing sight: 50 times the pixel's own

// a·z²/(n·v): a is the pixel's area at unit depth, v the ray of unit depth.
float pixel_area(Receiver surface, ivec2 image_size) {
    vec3 from_eye = surface.position_world - camera_to_world[3].xyz;
    float view_depth = -dot(camera_to_world[2].xyz, from_eye);
    vec3 ray = from_eye / view_depth;
    vec2 side = 2.0 * view_depth * tan_half_fov / vec2(image_size);
    return side.x * side.y / max(-dot(surface.normal_world, ray), MIN_EYE_COSINE * length(ray));
}
