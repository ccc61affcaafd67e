"""Lloyd iterations on the GPU: those of the formulas, whose flux they keep, and the same each time."""

import numpy as np
import pytest
from vector_file import VECTORS, buffer_of, inputs_of, light_of, vpl_rows

from examples.formulas.clustered_discs import lloyd_iteration
from examples.formulas.virtual_point_lights import DARK_NORMAL, Vpls
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.disc_samples import sample_count
from vpltune.renderer.frame.passes.clustered_discs import ClusteredDiscsPass
from vpltune.renderer.frame.vpl_pools import DiscPool
from vpltune.renderer.gpu.resources import Resources

LENGTH = 0.6
"""L of the samples, which fill a unit box."""


def random_samples(count: int) -> Vpls:
    """Samples on five sides of a unit box; one in ten is dark."""
    random = np.random.default_rng(count)
    axis, side = random.integers(0, 3, count), random.integers(0, 2, count)
    side[axis == 2] = 0
    position = random.random((count, 3))
    position[np.arange(count), axis] = side
    normal = np.zeros((count, 3))
    normal[np.arange(count), axis] = 1 - 2 * side
    lit = random.random(count) > 0.1
    normal[~lit] = DARK_NORMAL
    return Vpls(position, normal, 0.02 * lit, random.random((count, 3)) * lit[:, None])


def start_of(samples: Vpls, count: int) -> Vpls:
    return Vpls(
        samples.position[:count], samples.normal[:count], samples.footprint[:count], samples.flux[:count]
    )


class Clustering:
    """The pass alone, on samples of a test."""

    def __init__(self, gl_context, samples: Vpls, count: int):
        self.resources = Resources(gl_context)
        self.resources["first_samples"] = buffer_of(gl_context, vpl_rows(vars(samples)))
        self.resources["first_vpls"] = gl_context.buffer(reserve=48 * count)
        self.resources["frame_statistics"] = buffer_of(
            gl_context, np.float32([1.0, 1.0, LENGTH, 1.0, 0.0, 0.0, 0.0, 0.0])
        )
        self._count = count
        self._pass = ClusteredDiscsPass(self.resources, DiscPool.first(count))

    def clustered(self, iterations: int) -> np.ndarray:
        """[vpls, 12], as shaders have them."""
        light = light_of(VECTORS["rsm"]["light"])
        parameters = ArtistParameters(vpl_count=self._count, lloyd_iterations=iterations)
        self._pass.draw(inputs_of(light, parameters))
        return np.frombuffer(self.resources.read("first_vpls"), np.float32).reshape(-1, 12)


@pytest.mark.parametrize("count", [1, 50, 100])
def test_iterations_are_those_of_the_formulas(gl_context, count):
    """To 1e-4 for 98 % of the discs: a sample halfway between two may go to either as numbers are rounded."""
    samples = random_samples(sample_count(count))
    clustering = Clustering(gl_context, samples, count)
    expected = start_of(samples, count)
    for iterations in (1, 2):
        expected = lloyd_iteration(expected, samples, LENGTH)
        found = clustering.clustered(iterations)
        rows = vpl_rows(vars(expected))
        same = np.isclose(found[:, :11], rows[:, :11], rtol=1e-4, atol=1e-4).all(axis=1)
        assert same.mean() >= 0.98


@pytest.mark.parametrize("count", [50, 100])
def test_flux_is_kept(gl_context, count):
    """To float32's rounding: each lit sample belongs to one disc."""
    samples = random_samples(sample_count(count))
    found = Clustering(gl_context, samples, count).clustered(3)
    np.testing.assert_allclose(found[:, 8:11].sum(axis=0), samples.flux.sum(axis=0), rtol=1e-5)


def test_a_vpl_without_samples_is_dark_and_takes_none(gl_context):
    """VPLs that start dark, and one that starts where another does: the first of equals takes the samples."""
    samples = random_samples(sample_count(50))
    for values in (samples.position, samples.normal, samples.footprint, samples.flux):
        values[1] = values[0]
    assert samples.footprint[0] > 0.0 and (samples.footprint[:50] == 0.0).any()
    found = Clustering(gl_context, samples, 50).clustered(4)
    dark = samples.footprint[:50] == 0.0
    dark[1] = True
    np.testing.assert_array_equal(found[:, 7] == 0.0, dark)
    assert not found[dark, 8:11].any()


def test_the_same_to_the_last_bit_each_time(gl_context):
    """After other draws, and from a pass that is new."""
    samples = random_samples(sample_count(50))
    clustering = Clustering(gl_context, samples, 50)
    first = clustering.clustered(2).copy()
    clustering.clustered(1)
    np.testing.assert_array_equal(clustering.clustered(2), first)
    np.testing.assert_array_equal(Clustering(gl_context, samples, 50).clustered(2), first)
