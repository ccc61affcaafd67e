// The sampling weight of an RSM texel: flux^γ times the importance factor F of its cell, which says how much the camera
// would miss without the texel's light.
//
// Provides: `importance_factor`, `sampling_weight`. Needs common/artist_parameters.glsl and common/rsm.glsl.
// Constants: IMPORTANCE_CELLS, cells along the side of a face (renderer/frame/passes/vpl_importance.py).
// F is written by vpl_importance/vpl_importance.comp and vpl_importance_factor.comp. The web page's own version of the
// weight is in web/vpl_sums.glsl.

layout(std430, binding = VPL_IMPORTANCE_BINDING) buffer VplImportance {
    float vpl_importance[];  // [faces, IMPORTANCE_CELLS, IMPORTANCE_CELLS]: F
};

// The importance factor F of a texel, from its importance cell.
float importance_factor(int face, ivec2 texel_in_face) {
    ivec2 cell = texel_in_face * IMPORTANCE_CELLS / RSM_RESOLUTION;
    return vpl_importance[(face * IMPORTANCE_CELLS + cell.y) * IMPORTANCE_CELLS + cell.x];
}

// The weight with which a lit texel is drawn: flux^γ F.
float sampling_weight(ivec2 texel, float flux) {
    float weight = pow(flux, artist.density_exponent);
    // For η = 0 the importance passes do not run, and the buffer holds nothing valid.
    if (artist.density_importance > 0.0) {
        ivec2 tile = texel / RSM_RESOLUTION;
        weight *= importance_factor(tile.y * rsm_columns + tile.x, texel - tile * RSM_RESOLUTION);
    }
    return weight;
}
