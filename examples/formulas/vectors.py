"""Vector arithmetic over the last axis of an array."""

import numpy as np


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (np.asarray(a) * np.asarray(b)).sum(axis=-1)


def length(a: np.ndarray) -> np.ndarray:
    return np.sqrt(dot(a, a))


def unit(a: np.ndarray) -> np.ndarray:
    return a / length(a)[..., None]
