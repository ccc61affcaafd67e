"""OpenGL: context, shaders, scene buffers, render targets, rays."""
