"""Path tracing to a frame's error: the fit over samples, errors without noise, and a small run."""

import os
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.harness.scene_library import OWN_SCENES, own_scene
from benchmarks.quality.equal_error import (
    SEED,
    Effort,
    TracedRun,
    count_and_seconds,
    loaded,
    measured_rows,
    one_core,
    relmse_without_noise,
    scenes,
)
from vpltune.tuner.metrics.view_metrics import relmse
from vpltune.tuner.prior.scene_generator import generated_scene


def test_scenes_are_the_shipped_ones_and_two_generated_ones():
    """Each with a view of the size that is asked for, from its own camera and by its own lights."""
    views = [loaded(scene, (16, 9))[1] for scene in scenes()]
    shipped = [path.stem for path in OWN_SCENES]
    assert [view.name for view in views] == [*shipped, "room-000", "hall-001"]
    assert all(view.size == (16, 9) and view.lights for view in views)


def test_generated_scenes_come_from_a_seed_that_chose_nothing():
    """By the rule of docs/chosen_on.md: it leaves 2 when divided by 3."""
    made, _ = loaded(1, (16, 9))
    again = generated_scene(1, SEED)
    assert SEED % 3 == 2
    for mesh, same in zip(made.meshes, again.meshes, strict=True):
        np.testing.assert_array_equal(mesh.positions, same.positions)


def test_a_process_has_one_core_and_ours_keeps_its_own():
    before = os.sched_getaffinity(0)
    with one_core():
        command = [sys.executable, "-c", "import os; print(len(os.sched_getaffinity(0)))"]
        assert subprocess.run(command, capture_output=True, check=True).stdout.strip() == b"1"
    assert os.sched_getaffinity(0) == before


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_the_count_is_where_the_error_is_the_frame_s(power):
    """Exact for relMSE = 8/samples^p and seconds = 0.5 + 0.1·samples; of two runs, the faster counts."""
    runs = [TracedRun(n, 0.5 + 0.1 * n, 8.0 / n**power) for n in (4, 16, 64)]
    runs.append(TracedRun(16, 9.0, 8.0 / 16**power))
    count, seconds = count_and_seconds(runs, 8.0 / 30.0**power)
    assert count == pytest.approx(30.0)
    assert seconds == pytest.approx(3.5)


def test_a_picture_takes_a_sample_in_every_pixel():
    runs = [TracedRun(n, 0.1 * n, 1.0 / n) for n in (4, 16)]
    assert count_and_seconds(runs, 100.0) == (1.0, pytest.approx(0.1))


def test_the_reference_s_noise_cancels():
    """A perfect image has no error against halves with 3 % noise, whose mean is 2 % off; another keeps its.

    Tolerances: the product of two noises of 3 % has a mean of 2e-6 ± 2e-6 over 3e5 values. The weights of a
    10 % error come from the noisy mean, which adds 2 % of it.
    """
    random = np.random.default_rng(5)
    truth = np.full((100_000, 3), 2.0)
    half_a, half_b = (truth * (1.0 + 0.03 * random.normal(size=truth.shape)) for _ in range(2))
    assert abs(relmse_without_noise(truth, half_a, half_b)) < 1e-5
    assert relmse(truth, (half_a + half_b) / 2.0) == pytest.approx(4.5e-4, rel=0.03)
    exact = relmse(1.1 * truth, truth)
    assert relmse_without_noise(1.1 * truth, truth, truth) == pytest.approx(exact)
    assert relmse_without_noise(1.1 * truth, half_a, half_b) == pytest.approx(exact, rel=0.03)


@pytest.mark.slow
def test_a_small_run():
    effort = Effort(size=(32, 18), samples=(2, 8), rounds=1, reference_samples=64)
    row, median = measured_rows(lambda stage, share: None, [own_scene("cornell-box")], effort)
    assert row.name == "equal_error.cornell-box"
    assert row.value > 0.0 and row.against_value > 0.0
    assert "relMSE" in row.against and "samples a pixel" in row.against
    assert median.value == row.ratio
