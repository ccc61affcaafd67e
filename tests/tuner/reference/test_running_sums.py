"""Drawing by running sums: as often as the weights say, and evenly within an entry."""

import numpy as np
import pytest

from vpltune.tuner.reference.running_sums import drawn, probabilities, running_sums


@pytest.fixture
def wavefront():
    numpy_wavefront = pytest.importorskip("vpltune.tuner.reference.numpy_wavefront")
    return numpy_wavefront.NumpyWavefront.__new__(numpy_wavefront.NumpyWavefront)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 100])
def test_entries_come_as_often_as_their_weights(wavefront, count):
    weights = np.random.default_rng(count).random((2, count)) ** 3
    weights[1, 0] = weights[1, -1] = 0.0 if count > 2 else 1.0
    sums = running_sums(weights)
    shares = weights / weights.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(probabilities(sums, count), shares, atol=2.0**-21)
    u = ((np.arange(2**16) + 0.5) / 2**16).astype(np.float32)
    for row in range(2):
        first = np.full(u.shape, row * sums.shape[1], np.uint32)
        entry, place = drawn(wavefront, sums.ravel(), first, sums.shape[1], u)
        found = np.bincount(entry, minlength=count) / u.size
        np.testing.assert_allclose(found, shares[row], atol=2.0**-15)
        assert place.min() >= 0.0 and place.max() < 1.0
        assert place[entry == shares[row].argmax()].mean() == pytest.approx(0.5, abs=0.01)


def test_a_row_without_weight_has_its_last_entry():
    assert probabilities(running_sums(np.zeros((1, 3))), 3).tolist() == [[0.0, 0.0, 1.0]]
