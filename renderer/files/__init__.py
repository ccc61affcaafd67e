"""File access: atomic writes, images, video and strict JSON."""
