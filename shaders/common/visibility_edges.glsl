// Texels of visibility maps beside which one surface hides another, and the workgroups of an indirect dispatch
// that cast them once more.

layout(std430, binding = VISIBILITY_EDGES_BINDING) buffer VisibilityEdges {
    uint visibility_edge_groups[3];  // of an indirect dispatch: the first counts, the others are 1
    uint visibility_edge_count;      // may exceed VISIBILITY_BLOCKS, for which there is room
    uint visibility_edges[];         // [block]: its texel, counted over all maps
};

const int VISIBILITY_BLOCK_TEXELS = VISIBILITY_MAP_REFINEMENT * VISIBILITY_MAP_REFINEMENT;
