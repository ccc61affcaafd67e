// Pixels that are to be drawn once more, and the workgroups of 64 that an indirect dispatch needs for them.

layout(std430, binding = PIXEL_LIST_BINDING) buffer PixelList {
    uint pixel_list_groups[3];  // of an indirect dispatch: in rows of at most MOST_WORKGROUPS; the last is 1
    uint pixel_list_count;
    uint pixel_list[];          // x | y << 16
};

void append_pixel(ivec2 pixel) {
    uint index = atomicAdd(pixel_list_count, 1u);
    if (index % 64u == 0u) {
        uint group = index / 64u;
        atomicMax(pixel_list_groups[0], min(group + 1u, uint(MOST_WORKGROUPS)));
        atomicMax(pixel_list_groups[1], group / uint(MOST_WORKGROUPS) + 1u);
    }
    pixel_list[index] = uint(pixel.x) | uint(pixel.y) << 16;
}

// The listed pixel of a workgroup's lane, or (-1, -1) past the end of the list.
ivec2 listed_pixel(uvec2 group, uint lane) {
    uint index = (group.y * uint(MOST_WORKGROUPS) + group.x) * 64u + lane;
    if (index >= pixel_list_count) {
        return ivec2(-1);
    }
    return ivec2(pixel_list[index] & 0xffffu, pixel_list[index] >> 16);
}
