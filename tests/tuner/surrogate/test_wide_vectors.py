"""`wide_jit` works whether or not XLA knows the option for wide vectors."""

import jax.numpy as jnp
import pytest

import vpltune.tuner.surrogate.wide_vectors
from vpltune.tuner.surrogate.wide_vectors import WIDEST, wide_jit


@pytest.fixture
def nothing_known():
    vpltune.tuner.surrogate.wide_vectors._options.cache_clear()
    yield
    vpltune.tuner.surrogate.wide_vectors._options.cache_clear()


def test_this_version_of_xla_knows_the_option():
    assert vpltune.tuner.surrogate.wide_vectors._options() == WIDEST


def test_an_option_that_xla_does_not_know_is_left_out(monkeypatch, nothing_known):
    monkeypatch.setattr(vpltune.tuner.surrogate.wide_vectors, "WIDEST", {"xla_cpu_no_such_option": 512})
    assert vpltune.tuner.surrogate.wide_vectors._options() is None

    @wide_jit
    def doubled(x):
        """Twice x."""
        return x * 2.0

    assert doubled(jnp.float32(3.0)) == 6.0
    assert doubled.__doc__ == "Twice x."
