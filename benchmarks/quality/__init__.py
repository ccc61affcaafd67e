"""Benchmarks of image quality, in stills and in motion."""
