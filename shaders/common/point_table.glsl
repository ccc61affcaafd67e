// The table of points in [0, 1)² from which VPLs are placed, read by index. Python: renderer/frame/point_table.py.

layout(std430, binding = POINT_TABLE_BINDING) readonly buffer PointTable {
    vec2 point_table[];
};
