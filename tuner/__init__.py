"""Fits the artist parameters of virtual point lights to a path-traced reference."""
