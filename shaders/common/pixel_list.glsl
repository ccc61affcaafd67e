// A list of pixels for another pass, and the indirect dispatch of workgroups of 64 that processes it.
//
// Provides: `append_pixel` for the pass that fills the list, `listed_pixel` for the pass that reads it.
// Constants: MOST_WORKGROUPS, workgroups along one side of a dispatch (renderer/gpu/shader_library.py).
// Python: `PixelList` in renderer/gpu/render_targets.py, which empties it.

layout(std430, binding = PIXEL_LIST_BINDING) buffer PixelList {
    uint pixel_list_groups[3];  // indirect dispatch: x, at most MOST_WORKGROUPS; y; 1
    uint pixel_list_count;
    uint pixel_list[];          // x | y << 16
};

// Add a pixel. Every 64th one adds a workgroup.
void append_pixel(ivec2 pixel) {
    uint index = atomicAdd(pixel_list_count, 1u);
    if (index % 64u == 0u) {
        uint group = index / 64u;
        atomicMax(pixel_list_groups[0], min(group + 1u, uint(MOST_WORKGROUPS)));
        atomicMax(pixel_list_groups[1], group / uint(MOST_WORKGROUPS) + 1u);
    }
    pixel_list[index] = uint(pixel.x) | uint(pixel.y) << 16;
}

// The pixel for lane `lane` of workgroup `group`; (-1, -1) past the end of the list.
ivec2 listed_pixel(uvec2 group, uint lane) {
    uint index = (group.y * uint(MOST_WORKGROUPS) + group.x) * 64u + lane;
    if (index >= pixel_list_count) {
        return ivec2(-1);
    }
    return ivec2(pixel_list[index] & 0xffffu, pixel_list[index] >> 16);
}
