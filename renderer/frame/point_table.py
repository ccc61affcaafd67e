"""The tables of points from which VPLs are placed."""

import math
from typing import Literal

import numpy as np
from jaxtyping import Float32

PointTable = Literal["r2", "poisson_disc"]

# The root of x³ = x + 1, the plastic number: its powers give the R2 sequence (Roberts 2018).
_PLASTIC_NUMBER = 1.32471795724474602596
R2_STEPS = (1.0 / _PLASTIC_NUMBER, 1.0 / _PLASTIC_NUMBER**2)
"""What is added from each point of the R2 sequence to the next, modulo 1."""

POISSON_RADIUS = 0.75
"""Radius of the Poisson discs, in 1/√count. Darts thrown until none fits end near 0.83 (packing density
0.547, Tanemura 1979); 0.75 is reached for certain after some tens of darts for each point."""


def r2_sequence(count: int) -> Float32[np.ndarray, "count 2"]:
    """The first `count` points of the R2 sequence in [0, 1)².

    Every prefix is evenly spread (low discrepancy), so one table serves every number of VPLs and a
    count that changes from frame to frame moves no VPL that stays. Roberts 2018, "The Unreasonable
    Effectiveness of Quasirandom Sequences".
    """
    return _below_one((0.5 + np.arange(1, count + 1)[:, None] * np.array(R2_STEPS)) % 1.0)


def poisson_disc(count: int, seed: int) -> Float32[np.ndarray, "count 2"]:
    """`count` points in [0, 1)², none nearer than `POISSON_RADIUS`/√count to another, in no order.

    Dart throwing (Cook 1986) on the torus, so that a rotated table is as good. It is the pattern of the
    study that this runtime follows, kept for comparison: a shorter prefix of it is not evenly spread.
    """
    random = np.random.default_rng(seed)
    reach = POISSON_RADIUS / math.sqrt(count)
    points = np.empty((count, 2))
    found = 0
    while found < count:
        dart = random.random(2)
        apart = np.abs(points[:found] - dart)
        apart = np.minimum(apart, 1.0 - apart)
        if not ((apart**2).sum(axis=1) < reach**2).any():
            points[found] = dart
            found += 1
    return _below_one(points)


def point_table(kind: PointTable, count: int) -> Float32[np.ndarray, "count 2"]:
    """The table of that kind with `count` points; the same at every call."""
    return poisson_disc(count, seed=0) if kind == "poisson_disc" else r2_sequence(count)


def _below_one(points: np.ndarray) -> np.ndarray:
    # Rounding to float32 may give 1.0, which is outside the table's range.
    return np.minimum(points, np.nextafter(np.float32(1), np.float32(0))).astype(np.float32)
