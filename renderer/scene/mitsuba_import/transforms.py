"""Mitsuba's <transform>: a list of steps, applied in order."""

import math

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER
from vpltune.renderer.scene.mitsuba_import.values import numbers, vector
from vpltune.renderer.scene.mitsuba_import.xml_tree import XmlNode

Matrix = Float64[np.ndarray, "4 4"]


def transform(node: XmlNode) -> Matrix:
    """The matrix of a <transform> element.

    Raises:
        SceneFileError: a step is unknown, a number is missing or not finite, or the matrix is singular.
    """
    matrix = np.eye(4)
    for step in node.children:
        make = _STEPS.get(step.tag.lower())
        if make is None:
            raise SceneFileError(f"{step.where}: must be one of {', '.join(_STEPS)}")
        matrix = make(step) @ matrix
    if not (np.abs(matrix).max() <= LARGEST_NUMBER and abs(np.linalg.det(matrix[:3, :3])) > 0.0):
        raise SceneFileError(f"{node.where}: the transform must be finite and have an inverse")
    return matrix


def _translate(step: XmlNode) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = vector(step, 0.0)
    return matrix


def _scale(step: XmlNode) -> Matrix:
    return np.diag([*vector(step, 1.0), 1.0])


def _rotate(step: XmlNode) -> Matrix:
    """Rotation by `angle` degrees about an axis (Rodrigues 1840)."""
    axis = vector(step, 0.0)
    length = np.linalg.norm(axis)
    if not length > 0.0:
        raise SceneFileError(f"{step.where}: the axis must not be zero")
    x, y, z = axis / length
    angle = math.radians(numbers(step, "angle", 1)[0])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return matrix


def _matrix(step: XmlNode) -> Matrix:
    count = len(step.attributes.get("value", "").replace(",", " ").split())
    if count == 9:
        matrix = np.eye(4)
        matrix[:3, :3] = numbers(step, "value", 9).reshape(3, 3)
        return matrix
    matrix = numbers(step, "value", 16).reshape(4, 4)
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise SceneFileError(f"{step.where}: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
    return matrix


def _look_at(step: XmlNode) -> Matrix:
    """The matrix that looks from `origin` to `target`: along +Z, with +Y up and +X to the left."""
    origin, target = numbers(step, "origin", 3), numbers(step, "target", 3)
    up = numbers(step, "up", 3) if "up" in step.attributes else np.array([0.0, 1.0, 0.0])
    forward = target - origin
    left = np.cross(up, forward)
    if not (np.linalg.norm(forward) > 0.0 and np.linalg.norm(left) > 0.0):
        raise SceneFileError(f"{step.where}: origin and target must differ, and up must not lie along them")
    forward, left = forward / np.linalg.norm(forward), left / np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(forward, left), forward, origin], axis=1)
    return matrix


_STEPS = {
    "translate": _translate,
    "scale": _scale,
    "rotate": _rotate,
    "matrix": _matrix,
    "lookat": _look_at,
}
