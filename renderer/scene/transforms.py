"""Affine and rigid transforms: of points and normals, from parts, and of cameras that look somewhere."""

import numpy as np
from jaxtyping import Float32, Float64

from vpltune.renderer.scene.scene import Numbers

# The axes after x, y and z, and the ones after these.
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


def transform_points(
    matrix: Float64[np.ndarray, "4 4"], points: Float32[np.ndarray, "n 3"] | Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """The points mapped by an affine matrix, in double precision."""
    return points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def cofactor_matrix(matrix: Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "3 3"]:
    """The matrix det(M)·M⁻ᵀ of an affine map M: it maps the cross product of two edges as M maps the edges.

    It also exists for singular maps, and it keeps normals on the right side of mirrored surfaces.
    """
    linear = matrix[:3, :3]
    first, second = linear[_NEXT], linear[_AFTER]
    # Written out because np.cross takes ten times as long for three rows.
    return first[:, _NEXT] * second[:, _AFTER] - first[:, _AFTER] * second[:, _NEXT]


def transform_normals(
    matrix: Float64[np.ndarray, "4 4"], normals: Float32[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Unit normals transformed by the cofactor matrix of an affine map.

    A normal that maps to zero, as on a node scaled flat, stays zero.
    """
    mapped = normals.astype(np.float64) @ cofactor_matrix(matrix).T
    length = np.linalg.norm(mapped, axis=1, keepdims=True)
    return np.divide(mapped, length, out=np.zeros_like(mapped), where=length > 0.0)


def trs_matrices(
    translation: Float64[np.ndarray, "n 3"],
    rotation: Float64[np.ndarray, "n 4"],
    scale: Float64[np.ndarray, "n 3"],
) -> Float64[np.ndarray, "n 4 4"]:
    """The matrices translation · rotation · scale. Quaternions are (x, y, z, w), of any non-zero length."""
    x, y, z, w = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).T
    matrices = np.zeros((len(scale), 4, 4))
    matrices[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    matrices[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    matrices[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3] = translation
    matrices[:, 3, 3] = 1.0
    return matrices


def without_scale(to_world: Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "4 4"] | None:
    """The rigid transform with the same position, −Z direction and plane of −Z and +Y.

    Returns:
        None if the matrix is so flat that −Z and +Y no longer span a plane.
    """
    depth = np.linalg.norm(to_world[:3, 2])
    if not depth > 0.0:
        return None
    backward = to_world[:3, 2] / depth
    right = np.cross(to_world[:3, 1], backward)
    width = np.linalg.norm(right)
    if not width > 0.0:
        return None
    rigid = np.eye(4)
    rigid[:3, 0], rigid[:3, 2] = right / width, backward
    rigid[:3, 1] = np.cross(backward, rigid[:3, 0])
    rigid[:3, 3] = to_world[:3, 3]
    return rigid


def look_at(
    eye: Numbers,
    target: Numbers,
    up: Numbers | None = None,
) -> Float64[np.ndarray, "4 4"]:
    """Camera-to-world matrix of a camera at `eye` that looks at `target` along its −Z axis, with +Y up.

    Each is three numbers, in world units. `up` defaults to world +Y, or to world −Z if the view direction is
    within 2.5 degrees of vertical.

    Raises:
        ValueError: `eye` and `target` coincide.
    """
    eye = np.asarray(eye, np.float64)
    backward = eye - np.asarray(target, np.float64)
    distance = np.linalg.norm(backward)
    if not distance > 0.0:
        raise ValueError(f"look_at: eye and target must differ, got {eye.tolist()} twice")
    backward = backward / distance
    if up is None:
        up = (0.0, 1.0, 0.0) if abs(backward[1]) < 0.999 else (0.0, 0.0, -1.0)
    right = np.cross(np.asarray(up, np.float64), backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(backward, right), backward, np.asarray(eye, np.float64)], axis=1)
    return matrix
