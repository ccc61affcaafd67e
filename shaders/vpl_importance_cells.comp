// VPL importance, part 1: what stands in each cell of the RSM, from 4×4 of its texels.
#include "common/rsm.glsl"
#include "common/vpl_importance_buffers.glsl"

layout(local_size_x = 64) in;

const int CELLS_OF_FACE = IMPORTANCE_CELLS * IMPORTANCE_CELLS;

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= rsm_face_count * CELLS_OF_FACE) {
        return;
    }
    int face = index / CELLS_OF_FACE;
    ivec2 cell = ivec2(index % IMPORTANCE_CELLS, index % CELLS_OF_FACE / IMPORTANCE_CELLS);
    float total_flux = 0.0;
    float area = 0.0;
    vec3 normal = vec3(0.0);
    vec3 origin = vec3(0.0);  // positions are summed from the first lit one: near to it nothing is rounded off
    vec3 offset = vec3(0.0);
    for (int i = 0; i < 16; ++i) {
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
    // Normals that cancel (a thin wall seen edge on) leave no side for the light to go to.
    if (total_flux > 0.0 && length(normal) > 1e-4 * total_flux) {
        const float texels_of_sample = float(RSM_RESOLUTION * RSM_RESOLUTION) / float(CELLS_OF_FACE * 16);
        result.position_flux = vec4(origin + offset / total_flux, total_flux / 16.0);
        result.normal_area = vec4(normalize(normal), area * texels_of_sample);
    }
    importance_cells[index] = result;
}
