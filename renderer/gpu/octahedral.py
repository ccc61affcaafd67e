"""The octahedral map: unit vectors in two channels."""

import numpy as np
from jaxtyping import Float32


def octahedral_decode(encoded: Float32[np.ndarray, "*shape 2"]) -> Float32[np.ndarray, "*shape 3"]:
    """Unit vectors from two channels in [0, 1]. Twin: shaders/common/octahedral.glsl."""
    p = encoded * np.float32(2.0) - np.float32(1.0)
    z = 1.0 - np.abs(p).sum(axis=-1)
    sign = np.where(p >= 0.0, np.float32(1.0), np.float32(-1.0))
    folded = np.where((z < 0.0)[..., None], (1.0 - np.abs(p[..., ::-1])) * sign, p)
    direction = np.concatenate([folded, z[..., None]], axis=-1)
    return (direction / np.linalg.norm(direction, axis=-1, keepdims=True)).astype(np.float32)
