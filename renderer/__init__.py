"""The real-time runtime: numpy and OpenGL only, never jax or mitsuba."""
