"""The learnt prior behind `--config auto`: its training scenes, its training, and its card."""
