"""The learnt prior: its scenes, its training, its card."""
