"""Axis-aligned boxes: the small scene of docs/test_vectors.json."""

import numpy as np


def nearest_hit(
    boxes: list[dict], origin: np.ndarray, direction: np.ndarray
) -> tuple[float, int, np.ndarray]:
    """Distance along `direction`, index of the box (−1: none), and its outward normal."""
    nearest, index, normal = np.inf, -1, np.zeros(3)
    for i, box in enumerate(boxes):
        with np.errstate(divide="ignore"):
            slabs = (np.array([box["low"], box["high"]]) - origin) / direction
        entry, leave = slabs.min(axis=0), slabs.max(axis=0)
        axis = int(entry.argmax())
        if 0.0 < entry[axis] <= leave.min() and entry[axis] < nearest:
            nearest, index, normal = float(entry[axis]), i, np.zeros(3)
            normal[axis] = -np.sign(direction[axis])
    return nearest, index, normal


def bounds(boxes: list[dict]) -> np.ndarray:
    """Low and high corner of all boxes."""
    return np.array(
        [np.min([box["low"] for box in boxes], axis=0), np.max([box["high"] for box in boxes], axis=0)]
    )
