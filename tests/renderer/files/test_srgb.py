"""The sRGB transfer curve at points from the standard."""

import numpy as np

from vpltune.renderer.files.srgb import linear_from_srgb, srgb_from_linear


def test_black_white_and_the_middle():
    # 0.2140 is the linear value of sRGB 0.5, by the standard's own decoding formula.
    linear = np.array([0.0, ((0.5 + 0.055) / 1.055) ** 2.4, 1.0])
    np.testing.assert_allclose(srgb_from_linear(linear), [0.0, 0.5, 1.0], atol=1e-12)


def test_the_two_pieces_meet():
    # The standard's rounded constants leave a step of 3e-8 at the junction.
    either_side = srgb_from_linear(np.array([0.0031308, 0.0031308 + 1e-12]))
    assert abs(np.diff(either_side)[0]) < 1e-7


def test_outside_values_are_clamped_and_single_precision_stays():
    # 1.055 - 0.055 differs from 1 by one rounding.
    outside = srgb_from_linear(np.array([-1.0, 2.0, np.inf]))
    np.testing.assert_allclose(outside, [0.0, 1.0, 1.0], atol=1e-15)
    assert srgb_from_linear(np.ones(3, np.float32)).dtype == np.float32


def test_decoding_undoes_encoding():
    # With the standard's rounded constants, the two pieces differ by 3e-8 at the junction.
    linear = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(linear)), linear, atol=1e-7)
