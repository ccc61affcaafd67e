// The frame statistics: what the GPU measures of the light in every frame, and among it the scene length L.
// Written by virtual_point_lights/vpl_marginal_density.comp. Python: renderer/frame/passes/virtual_point_lights.py.

layout(std430, binding = FRAME_STATISTICS_BINDING) buffer FrameStatistics {
    float total_weight;   // sum over RSM texels of the sampling weight (common/vpl_importance.glsl)
    float total_flux;     // sum over RSM texels of mean_flux [W]
    float scene_length;   // L: flux-weighted RMS distance of lit texels from their centroid [world units]
    float lit_texels;
    vec3 light_middle;    // the centroid, relative to `moment_origin` [world units]
};
