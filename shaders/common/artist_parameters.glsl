// What an artist can turn, as of this frame. The members are made from the table in renderer/config/artist_parameters.py.

layout(std430, binding = ARTIST_PARAMETERS_BINDING) readonly buffer ArtistParameters {
    ARTIST_PARAMETERS_MEMBERS
} artist;
