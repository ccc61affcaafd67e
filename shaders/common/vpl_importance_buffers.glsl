// The buffers between the importance passes: cells of the RSM, and surface points that stand for the image.
// Constants: IMPORTANCE_CELLS and IMPORTANCE_RECEIVERS of renderer/frame/passes/vpl_importance.py.
#include "common/vpl_importance_form.glsl"

layout(std430, binding = IMPORTANCE_CELLS_BINDING) buffer ImportanceCells {
    ImportanceCell importance_cells[];  // [faces, IMPORTANCE_CELLS, IMPORTANCE_CELLS]
};

layout(std430, binding = IMPORTANCE_RECEIVERS_BINDING) buffer ImportanceReceivers {
    ImportanceReceiver importance_receivers[IMPORTANCE_RECEIVERS];
};
