// The sampling weight of an RSM texel: flux^γ, times what the camera would miss without the texel's light.
// Needs common/artist_parameters.glsl and common/rsm.glsl. Made by shaders/vpl_importance/vpl_importance_factor.comp; see there and vpl_importance.comp.

layout(std430, binding = VPL_IMPORTANCE_BINDING) buffer VplImportance {
    float vpl_importance[];  // [faces, IMPORTANCE_CELLS, IMPORTANCE_CELLS], a factor of the weight
};

float importance_factor(int face, ivec2 texel_in_face) {
    ivec2 cell = texel_in_face * IMPORTANCE_CELLS / RSM_RESOLUTION;
    return vpl_importance[(face * IMPORTANCE_CELLS + cell.y) * IMPORTANCE_CELLS + cell.x];
}

float sampling_weight(ivec2 texel, float flux) {
    float weight = pow(flux, artist.density_exponent);
    // Without importance nothing is measured, and the buffer holds nothing.
    if (artist.density_importance > 0.0) {
        ivec2 tile = texel / RSM_RESOLUTION;
        weight *= importance_factor(tile.y * rsm_columns + tile.x, texel - tile * RSM_RESOLUTION);
    }
    return weight;
}
