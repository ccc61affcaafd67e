// The artist parameters of this frame, read as `artist.<name>`.
// Constants: ARTIST_PARAMETERS_MEMBERS, the members' declarations: renderer/config/parameter_block.py makes them from
// the table in renderer/config/artist_parameters.py.
// Written by renderer/frame/frame.py and by auto_parameters/auto_parameters.comp.

layout(std430, binding = ARTIST_PARAMETERS_BINDING) readonly buffer ArtistParameters {
    ARTIST_PARAMETERS_MEMBERS
} artist;
