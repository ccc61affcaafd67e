// Web page: reads VPLs from textures, VPL_COLUMNS in a row. Provides: `vpl_at`.
uniform sampler2D vpl_position_footprint;
uniform sampler2D vpl_normal_area;
uniform sampler2D vpl_flux;

VirtualPointLight vpl_at(int index) {
    ivec2 texel = ivec2(index % VPL_COLUMNS, index / VPL_COLUMNS);
    return VirtualPointLight(
        texelFetch(vpl_position_footprint, texel, 0),
        texelFetch(vpl_normal_area, texel, 0),
        texelFetch(vpl_flux, texel, 0));
}
