// Receiver bounds: boxes around all that the camera sees, and the bounds of the normals in each.
//
// Filled by receiver_bounds/receiver_bounds.comp, read by vpl_visibility_maps/vpl_visibility_marks.comp.
// Python: renderer/frame/passes/receiver_bounds.py, which empties the list.

struct ReceiverBounds {
    vec4 low, high;                // world position; w unused
    vec4 normal_low, normal_high;  // components of the shading normal; w unused
};

layout(std430, binding = RECEIVER_BOUNDS_BINDING) buffer ReceiverBoundsList {
    uint receiver_bounds_count;  // may exceed the room for boxes: then some are missing
    uint receiver_bounds_padding[3];
    ReceiverBounds receiver_bounds[];
};
