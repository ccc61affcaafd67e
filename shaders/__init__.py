"""GLSL sources, as package data; shaders/README.md says how they are named."""
