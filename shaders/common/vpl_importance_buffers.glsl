// What importance is measured between: cells of the RSM, and a few hundred surface points that the camera sees.

struct ImportanceCell {
    vec4 position_flux;  // flux-weighted mean position; mean flux of a texel [W], 0 where nothing is lit
    vec4 normal_area;    // unit normal; area on the surface [world units²]
};

layout(std430, binding = IMPORTANCE_CELLS_BINDING) buffer ImportanceCells {
    ImportanceCell importance_cells[];  // [faces, IMPORTANCE_CELLS, IMPORTANCE_CELLS]
};

struct ImportanceReceiver {
    vec4 position_valid;
    vec4 normal_irradiance;  // estimate from all cells, without visibility, in an arbitrary unit
};

layout(std430, binding = IMPORTANCE_RECEIVERS_BINDING) buffer ImportanceReceivers {
    ImportanceReceiver importance_receivers[IMPORTANCE_RECEIVERS];
};

// Irradiance at a receiver for each watt of the cell, the light spread over the cell's own disc.
float cell_form(vec3 position_world, vec3 normal_world, ImportanceCell cell) {
    vec3 to_cell = cell.position_flux.xyz - position_world;
    float distance_squared = max(dot(to_cell, to_cell), 1e-30);
    float cosines = max(dot(normal_world, to_cell), 0.0) * max(-dot(cell.normal_area.xyz, to_cell), 0.0);
    return cosines / distance_squared / (PI * distance_squared + IMPORTANCE_SPREAD * cell.normal_area.w);
}
