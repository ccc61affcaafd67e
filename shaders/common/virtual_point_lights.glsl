// A virtual point light (VPL): a small light on a lit surface. It stands for a disc around it of radius `footprint`, l,
// and of area π l².
// Twin: `VirtualPointLights` in tuner/surrogate/virtual_point_lights.py. Bytes: `VPL_DTYPE` in
// renderer/techniques/gathered_vpls.py.

struct VirtualPointLight {
    vec4 position_footprint;  // world position; footprint [world units]
    vec4 normal_area;         // unit normal; area it stands for [world units²]
    vec4 flux;                // radiant flux reflected [W]
};

// A VPL without light: no flux, no area, and any unit normal.
const VirtualPointLight NO_VPL = VirtualPointLight(vec4(0.0), vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0));
