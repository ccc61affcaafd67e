// What importance is measured between: cells of the RSM, and a few hundred surface points that the camera sees.

struct ImportanceCell {
    vec4 position_flux;  // flux-weighted mean position; mean flux of a texel [W], 0 where nothing is lit
    vec4 normal_area;    // unit normal; area on the surface [world units²]
};

struct ImportanceReceiver {
    vec4 position_valid;
    vec4 normal_irradiance;  // estimate from all cells, without visibility, in an arbitrary unit
};

// Below it, one surface is in the other's plane, and rounding says on which side. Cells that a receiver got a crumb
// from would count in the mean importance, which went up and down with them.
const float LEAST_COSINE = 1e-3;

// Irradiance at a receiver for each watt of the cell, the light spread over the cell's own disc.
float cell_form(vec3 position_world, vec3 normal_world, ImportanceCell cell) {
    vec3 to_cell = cell.position_flux.xyz - position_world;
    float distance_squared = max(dot(to_cell, to_cell), 1e-30);
    float least = LEAST_COSINE * sqrt(distance_squared);
    float cosines = max(dot(normal_world, to_cell) - least, 0.0) * max(-dot(cell.normal_area.xyz, to_cell) - least, 0.0);
    return cosines / distance_squared / (PI * distance_squared + IMPORTANCE_SPREAD * cell.normal_area.w);
}

float disc_irradiance(vec3 position_world, vec3 normal_world, ImportanceCell cell) {
    return cell.position_flux.w > 0.0 ? cell.position_flux.w * cell_form(position_world, normal_world, cell) : 0.0;
}

// How much an error at a receiver counts; `dark` is the irradiance squared below which it no longer counts for more.
float receiver_weight(ImportanceReceiver receiver, float dark) {
    float irradiance = receiver.normal_irradiance.w;
    return dark > 0.0 ? receiver.position_valid.w / (irradiance * irradiance / dark + 1.0) : 0.0;
}
