// Marks on the texels of visibility maps that a visible receiver may look up.
//
// Written by vpl_visibility_maps/vpl_visibility_marks.comp.
// Constants: VISIBILITY_MAP_SIZE of renderer/frame/visibility_map_layout.py.
// Python: renderer/frame/passes/vpl_visibility_maps.py.

layout(std430, binding = VISIBILITY_MARKS_BINDING) buffer VisibilityMarks {
    uvec2 visibility_marks[];  // [vpls, size]: one for each row of a map, with a bit for each column
};

// Whether any of the texels within `reach` of a texel is marked.
bool is_marked(int vpl_index, ivec2 texel, int reach) {
    ivec2 first = max(texel - reach, ivec2(0));
    ivec2 last = min(texel + reach, ivec2(VISIBILITY_MAP_SIZE - 1));
    uvec2 row = uvec2(0u);
    for (int y = first.y; y <= last.y; ++y) {
        row |= visibility_marks[vpl_index * VISIBILITY_MAP_SIZE + y];
    }
    for (int x = first.x; x <= last.x; ++x) {
        if ((row[x / 32] >> uint(x % 32) & 1u) != 0u) {
            return true;
        }
    }
    return false;
}

// The number of marked texels of a map.
int marked_texels(int vpl_index) {
    int count = 0;
    for (int y = 0; y < VISIBILITY_MAP_SIZE; ++y) {
        uvec2 row = visibility_marks[vpl_index * VISIBILITY_MAP_SIZE + y];
        count += bitCount(row.x) + bitCount(row.y);
    }
    return count;
}
