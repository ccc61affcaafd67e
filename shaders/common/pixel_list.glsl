// Pixels that are to be drawn once more, and the workgroups of 64 that an indirect dispatch needs for them.

layout(std430, binding = PIXEL_LIST_BINDING) buffer PixelList {
    uint pixel_list_groups[3];  // of an indirect dispatch: the first counts, the others are 1
    uint pixel_list_count;
    uint pixel_list[];          // x | y << 16
};

void append_pixel(ivec2 pixel) {
    uint index = atomicAdd(pixel_list_count, 1u);
    if (index % 64u == 0u) { atomicAdd(pixel_list_groups[0], 1u); }
    pixel_list[index] = uint(pixel.x) | uint(pixel.y) << 16;
}

// The listed pixel of this index, or (-1, -1) past the end of the list.
ivec2 listed_pixel(uint index) {
    if (index >= pixel_list_count) {
        return ivec2(-1);
    }
    return ivec2(pixel_list[index] & 0xffffu, pixel_list[index] >> 16);
}
