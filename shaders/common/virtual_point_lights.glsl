// A virtual point light (VPL) stands for a disc of radius `footprint` around it.

struct VirtualPointLight {
    vec4 position_footprint;  // world position; footprint [world units]
    vec4 normal_area;         // unit normal; area it stands for [world units²]
    vec4 flux;                // radiant flux reflected [W]
};

const VirtualPointLight NO_VPL = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));
