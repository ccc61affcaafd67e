// Depth from the triangle's plane, not from interpolated positions: software rasterisers interpolate to some 2e-4,
// which a visibility map's bias of 2e-3 of a distance does not forgive.
flat in vec3 plane_point;
flat in vec3 plane_normal;

// How many times `ray` from `start` reaches the plane; `interpolated` where they are all but parallel.
float plane_distance(vec3 start, vec3 ray, float interpolated) {
    float along = dot(plane_normal, ray);
    float distance = dot(plane_normal, plane_point - start) / along;
    return abs(along) > 1e-4 * length(ray) && abs(distance - interpolated) < 0.02 * interpolated ? distance : interpolated;
}
