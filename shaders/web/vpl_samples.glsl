// Web page: reads RSM samples from textures, laid out as VPLs are. Provides: `sample_at`.
uniform sampler2D sample_position_footprint;
uniform sampler2D sample_normal_area;
uniform sampler2D sample_flux;

VirtualPointLight sample_at(ivec2 texel) {
    return VirtualPointLight(
        texelFetch(sample_position_footprint, texel, 0),
        texelFetch(sample_normal_area, texel, 0),
        texelFetch(sample_flux, texel, 0));
}
