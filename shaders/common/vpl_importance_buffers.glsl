#include "common/vpl_importance_form.glsl"

layout(std430, binding = IMPORTANCE_CELLS_BINDING) buffer ImportanceCells {
    ImportanceCell importance_cells[];  // [faces, IMPORTANCE_CELLS, IMPORTANCE_CELLS]
};

layout(std430, binding = IMPORTANCE_RECEIVERS_BINDING) buffer ImportanceReceivers {
    ImportanceReceiver importance_receivers[IMPORTANCE_RECEIVERS];
};
