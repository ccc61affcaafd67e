"""The table of points from which VPLs are placed."""

import numpy as np
from jaxtyping import Float32

# The root of x³ = x + 1, the plastic number: its powers give the R2 sequence (Roberts 2018).
_PLASTIC_NUMBER = 1.32471795724474602596


def r2_sequence(count: int) -> Float32[np.ndarray, "count 2"]:
    """The first `count` points of the R2 sequence in [0, 1)².

    Every prefix is evenly spread (low discrepancy), so one table serves every number of VPLs and a
    count that changes from frame to frame moves no VPL that stays. Roberts 2018, "The Unreasonable
    Effectiveness of Quasirandom Sequences".
    """
    steps = np.array([1.0 / _PLASTIC_NUMBER, 1.0 / _PLASTIC_NUMBER**2])
    points = (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0
    # Rounding to float32 may give 1.0, which is outside the table's range.
    return np.minimum(points, np.nextafter(np.float32(1), np.float32(0))).astype(np.float32)
