"""The tuner: fits the parameters of virtual point lights to a path-traced reference."""
