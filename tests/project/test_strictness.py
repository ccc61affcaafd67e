"""The strictness that every other test counts on is really on."""

import warnings

import jaxtyping
import numpy as np
import pytest

from vpltune.renderer.scene.transforms import transform_points


def test_floating_point_errors_raise():
    with pytest.raises(FloatingPointError):
        np.ones(2) / np.zeros(2)


def test_annotations_of_shapes_are_checked():
    with pytest.raises(jaxtyping.TypeCheckError):
        transform_points(np.eye(4), np.zeros((3, 2)))


def test_warnings_are_errors():
    with pytest.raises(UserWarning, match="careful"):
        warnings.warn("careful", UserWarning, stacklevel=1)
