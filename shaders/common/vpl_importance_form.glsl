// The quantities that importance is computed from: importance cells of the RSM (squares of texels), and the receivers,
// surface points that the camera sees.
//
// Provides: the structs, `cell_form`, `disc_irradiance`, `receiver_weight`. Needs PI.
// Constants: IMPORTANCE_SPREAD of renderer/frame/passes/vpl_importance.py. Used by the runtime and the web page.

struct ImportanceCell {
    vec4 position_flux;  // flux-weighted mean position; mean flux of a texel [W], 0 where nothing is lit
    vec4 normal_area;    // unit normal; area on the surface [world units²]
};

struct ImportanceReceiver {
    vec4 position_valid;     // world position; 1 where the camera sees a surface, else 0
    vec4 normal_irradiance;  // unit normal; irradiance from all cells without visibility, in an arbitrary unit
};

// A choice. Below this cosine, one surface lies in the plane of the other, and rounding decides on which side.
const float LEAST_COSINE = 1e-3;

// A choice: share of what a cell would give square on that it counts for at least. Surfaces that face away but lie near,
// such as a roof over a lit floor, are then not drawn as sparsely, and with as much flux, as ground far away. A clustered
// disc of the floor may take their samples.
const float LEAST_COSINE_PRODUCT = 0.01;

// Irradiance at a receiver for each watt of the cell. The light is spread over IMPORTANCE_SPREAD times the cell's area
// and so stays finite close to the cell.
float cell_form(vec3 position_world, vec3 normal_world, ImportanceCell cell) {
    vec3 to_cell = cell.position_flux.xyz - position_world;
    float distance_squared = max(dot(to_cell, to_cell), 1e-30);
    float least = LEAST_COSINE * sqrt(distance_squared);
    float cosines = max(dot(normal_world, to_cell) - least, 0.0) * max(-dot(cell.normal_area.xyz, to_cell) - least, 0.0);
    return max(cosines / distance_squared, LEAST_COSINE_PRODUCT)
        / (PI * distance_squared + IMPORTANCE_SPREAD * cell.normal_area.w);
}

// Irradiance at a receiver from a cell; 0 from a dark cell.
float disc_irradiance(vec3 position_world, vec3 normal_world, ImportanceCell cell) {
    return cell.position_flux.w > 0.0 ? cell.position_flux.w * cell_form(position_world, normal_world, cell) : 0.0;
}

// The weight of an error at a receiver, up to a constant factor: 1 / (E² + dark). `dark` is a squared irradiance, below
// which receivers hardly count for more.
float receiver_weight(ImportanceReceiver receiver, float dark) {
    float irradiance = receiver.normal_irradiance.w;
    return dark > 0.0 ? receiver.position_valid.w / (irradiance * irradiance / dark + 1.0) : 0.0;
}
