// Web page: depth computed from the plane of the triangle and not interpolated. Software rasterisers interpolate
// positions to some 2e-4, which is too coarse for the bias of the visibility maps.
//
// Provides: `plane_distance`. Reads the flat outputs of web/scene.vert.
flat in vec3 plane_point;
flat in vec3 plane_normal;

// The distance from `start` to the plane in units of `ray`'s length. `interpolated` is returned where ray and plane are
// nearly parallel, or where the two differ by more than 2 %. Both bounds are choices.
float plane_distance(vec3 start, vec3 ray, float interpolated) {
    float along = dot(plane_normal, ray);
    float distance = dot(plane_normal, plane_point - start) / along;
    return abs(along) > 1e-4 * length(ray) && abs(distance - interpolated) < 0.02 * interpolated ? distance : interpolated;
}
