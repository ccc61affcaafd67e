// The list of visibility-map texels at silhouettes, and the indirect dispatch that casts finer rays for them.
//
// Filled by vpl_visibility_edges.comp, processed by vpl_visibility_details.comp.
// Constants: VISIBILITY_MAP_REFINEMENT (renderer/frame/visibility_map_layout.py), VISIBILITY_BLOCKS.
// Python: renderer/frame/passes/vpl_visibility_maps.py, which empties it.

layout(std430, binding = VISIBILITY_EDGES_BINDING) buffer VisibilityEdges {
    uint visibility_edge_groups[3];  // indirect dispatch: number of workgroups, 1, 1
    uint visibility_edge_count;      // may exceed VISIBILITY_BLOCKS, the room there is
    uint visibility_edges[];         // [block]: index of its texel, counted over all maps
};

// Texels of a block: each replaces one texel at a silhouette.
const int VISIBILITY_BLOCK_TEXELS = VISIBILITY_MAP_REFINEMENT * VISIBILITY_MAP_REFINEMENT;
