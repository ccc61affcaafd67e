"""What is compiled for wide vectors, whether or not XLA knows the option."""

import jax.numpy as jnp
import pytest

import tuner.wide_vectors
from tuner.wide_vectors import WIDEST, wide_jit


@pytest.fixture
def nothing_known():
    tuner.wide_vectors._options.cache_clear()
    yield
    tuner.wide_vectors._options.cache_clear()


def test_this_version_of_xla_knows_the_option():
    assert tuner.wide_vectors._options() == WIDEST


def test_an_option_that_xla_does_not_know_is_left_out(monkeypatch, nothing_known):
    monkeypatch.setattr(tuner.wide_vectors, "WIDEST", {"xla_cpu_no_such_option": 512})
    assert tuner.wide_vectors._options() is None

    @wide_jit
    def doubled(x):
        """Twice x."""
        return x * 2.0

    assert doubled(jnp.float32(3.0)) == 6.0
    assert doubled.__doc__ == "Twice x."
