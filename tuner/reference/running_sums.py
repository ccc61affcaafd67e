"""Drawing one of many with given probabilities, by searching running sums.

The number in [0, 1) that chose is used up only in part: its place between two sums is again even over [0, 1).
So points that fill the square evenly still do after they have chosen (Shirley et al. 1996, "Monte Carlo
Techniques for Direct Lighting Calculations").
"""

import numpy as np
from jaxtyping import Float32, Float64

STEPS = 2.0**22
"""Running sums are multiples of 1/STEPS. A random number has 24 bits, and 23 after a choice between two, so
that it falls between two sums exactly as often as their difference says. An entry far below 1/STEPS is drawn
never, or as often as its neighbours together."""


def running_sums(weights: Float64[np.ndarray, "rows n"]) -> Float32[np.ndarray, "rows size"]:
    """For each row the share of the weights before each entry, filled up with 2 to a power of two above n.

    Args:
        weights: ≥ 0 and finite. Where all of a row are 0, the last entry has them all.
    """
    count = weights.shape[1]
    ends = np.cumsum(weights, axis=1)
    ends /= np.where(ends[:, -1:] > 0.0, ends[:, -1:], 1.0)
    sums = np.full((len(weights), 1 << count.bit_length()), 2.0)
    sums[:, 0] = 0.0
    sums[:, 1:count] = np.round(ends[:, :-1] * STEPS) / STEPS
    return sums.astype(np.float32)


def probabilities(sums: Float32[np.ndarray, "rows size"], count: int) -> Float64[np.ndarray, "rows count"]:
    """The probability with which `drawn` finds each of the `count` entries of each row."""
    ends = np.minimum(sums[:, : count + 1].astype(np.float64), 1.0)
    return np.diff(ends, axis=1)


def drawn(wavefront, table, first, size: int, u):
    """The entry that a number u in [0, 1) falls on, and its place within it, in [0, 1).

    Args:
        wavefront: does the arithmetic.
        table: rows of `running_sums`.
        first: index in `table` where a row begins, for each lane.
        size: length of a row.
        u: a number for each lane.
    """
    w = wavefront
    found = first + w.to_index(u * 0.0)
    step = size // 2
    while step:
        found = w.where(w.take(table, found + step) <= u, found + step, found)
        step //= 2
    low, high = w.take(table, found), w.minimum(w.take(table, found + 1), 1.0)
    # The bounds only guard lanes that draw nothing: elsewhere low ≤ u < high, at least 1/STEPS apart.
    place = (u - low) / w.maximum(high - low, 1.0 / STEPS)
    return found - first, w.minimum(w.maximum(place, 0.0), 1.0 - 2.0**-24)
