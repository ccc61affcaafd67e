"""The table of points that VPLs are drawn at: docs/runtime_formulas.md, "Point table"."""

import numpy as np

PLASTIC_NUMBER = 1.32471795724474602596
"""The real root of x³ = x + 1."""
STEP = np.array([1.0 / PLASTIC_NUMBER, 1.0 / PLASTIC_NUMBER**2])


def r2_points(count: int) -> np.ndarray:
    """Points 1 … count of the R2 sequence, [count, 2] in [0, 1)², as the float32 values that shaders read."""
    points = (0.5 + np.arange(1, count + 1)[:, None] * STEP) % 1.0
    return np.minimum(points, np.nextafter(np.float32(1), np.float32(0))).astype(np.float32)


def rotated(points: np.ndarray, rotation: tuple[float, float]) -> np.ndarray:
    """The table shifted on its torus (Cranley and Patterson 1976)."""
    return (points.astype(np.float64) + np.array(rotation)) % 1.0
