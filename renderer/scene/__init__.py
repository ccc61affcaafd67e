"""The scene in numpy: meshes, lights, views, motion, and the readers that make it."""
