// One importance cell of the RSM, summarised from 4×4 of its texels.
//
// Provides: `importance_cell`. Needs common/rsm.glsl and common/vpl_importance_form.glsl.
// Constants: RSM_RESOLUTION; IMPORTANCE_CELLS of renderer/frame/passes/vpl_importance.py.

// Flux, area, and flux-weighted mean position and normal of an importance cell.
ImportanceCell importance_cell(int face, ivec2 cell) {
    float total_flux = 0.0;
    float area = 0.0;
    vec3 normal = vec3(0.0);
    vec3 origin = vec3(0.0);  // the first lit position: offsets from it are short, so the sum loses few digits
    vec3 offset = vec3(0.0);
    for (int i = 0; i < 16; ++i) {  // 4×4 texels, evenly spread over the cell
        vec2 place = (vec2(cell) + (vec2(i % 4, i / 4) + 0.5) / 4.0) / float(IMPORTANCE_CELLS);
        RsmTexel texel = rsm_texel(rsm_tile_origin(face) + ivec2(place * float(RSM_RESOLUTION)));
        float flux = mean_flux(texel.flux);
        if (flux > 0.0) {
            if (total_flux == 0.0) {
                origin = texel.position_world;
            }
            total_flux += flux;
            area += texel.area;
            normal += flux * texel.normal_world;
            offset += flux * (texel.position_world - origin);
        }
    }
    ImportanceCell result = ImportanceCell(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0));
    // Where the normals cancel (a thin wall seen edge on), the cell has no direction to shine in and stays dark.
    if (total_flux > 0.0 && length(normal) > 1e-4 * total_flux) {
        // RSM texels for each of the 16 samples.
        const float texels_of_sample =
            float(RSM_RESOLUTION * RSM_RESOLUTION) / float(IMPORTANCE_CELLS * IMPORTANCE_CELLS * 16);
        result.position_flux = vec4(origin + offset / total_flux, total_flux / 16.0);
        result.normal_area = vec4(normalize(normal), area * texels_of_sample);
    }
    return result;
}
