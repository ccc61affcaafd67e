// VPL importance, part 1: summarises the RSM in importance cells. One invocation for each cell.
//
// Reads: the RSM. Writes: importance cells. Python: renderer/frame/passes/vpl_importance.py.
// Constants: IMPORTANCE_CELLS, cells along the side of a face, from the same.
#include "common/rsm.glsl"
#include "common/vpl_importance_buffers.glsl"
#include "common/vpl_importance_cell.glsl"

layout(local_size_x = 64) in;

const int CELLS_OF_FACE = IMPORTANCE_CELLS * IMPORTANCE_CELLS;

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index < rsm_face_count * CELLS_OF_FACE) {
        ivec2 cell = ivec2(index % IMPORTANCE_CELLS, index % CELLS_OF_FACE / IMPORTANCE_CELLS);
        importance_cells[index] = importance_cell(index / CELLS_OF_FACE, cell);
    }
}
