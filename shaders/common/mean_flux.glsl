// Provides: `mean_flux`.

// Flux as one number: the mean of the channels, because the error measure weighs all channels alike.
float mean_flux(vec3 flux) {
    return (flux.r + flux.g + flux.b) / 3.0;
}
