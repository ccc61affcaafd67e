"""Bounds of a disc of light, for `shaders/common/vpl_disc.glsl` and its twin `tuner.surrogate.vpl_disc`."""

from vpltune.renderer.frame.visibility_map_layout import VISIBILITY_LIFT

LEAST_PART = 1e-4
"""Share of a disc's area over a receiver's horizon below which it gives nothing: it has two digits left."""
LEAST_RADIUS = 1e-6
"""In L: dark VPLs have no footprint."""
FADE_HEIGHT = VISIBILITY_LIFT
"""In radii: where a disc's light begins to fade towards its own plane. At half of that it is gone: so near,
an RSM's depth does not tell which side of a surface a receiver is on. A choice of 0.02, 0.01, 0.005 and
0.002. With 0.02, the last pixel of a floor before a wall is dark; below 0.01, nothing is gained."""
FACING_FADE_HEIGHT = 0.4
"""In radii: how much higher a receiver fades that faces the disc's plane squarely. On the other side of a
curtain's fold, or under a low board, one ray says too little. A choice of 0, 0.1, 0.2 and 0.4: folded
curtains, and boards 3 to 20 cm above a floor, have the least error."""

DEFINES = {
    "DISC_LEAST_PART": LEAST_PART,
    "DISC_LEAST_RADIUS": LEAST_RADIUS,
    "DISC_FADE_HEIGHT": FADE_HEIGHT,
    "DISC_FACING_FADE_HEIGHT": FACING_FADE_HEIGHT,
}
