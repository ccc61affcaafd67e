"""Files: whole-or-nothing writes, images, video, strict JSON."""
