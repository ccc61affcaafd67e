// What the runtime measures of the light in the scene, every frame, on the GPU.

layout(std430, binding = FRAME_STATISTICS_BINDING) buffer FrameStatistics {
    float total_weight;   // sum over RSM texels of the sampling weight (common/vpl_importance.glsl)
    float total_flux;     // sum over RSM texels of mean_flux [W]
    float scene_length;   // L: flux-weighted RMS distance of lit texels from their centroid [world units]
    float lit_texels;
};
