"""Training on planted losses: a prior learns what follows from the statistics and ignores left-out scenes."""

import dataclasses

import jax
import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.tuner.prior.loss_table import (
    BIAS_PLACES,
    FOOTPRINT_PLACES,
    LOWEST_POINT,
    SOFTNESS_PLACES,
    LossTable,
    default_point,
)
from vpltune.tuner.prior.prior_library import PriorScene
from vpltune.tuner.prior.prior_training import DEFAULT, own_fits, row_losses, train, training_rows

SCENES = 16  # a choice
COUNTS = (16, 64)  # VPL counts, a choice


def planted_best(statistics: np.ndarray) -> np.ndarray:
    """α follows the third statistic; all other parameters stay at the defaults.

    Two nodes away from the ends of the table, where its spline has no curvature.
    """
    return default_point(ArtistParameters()) + np.array([0.0, 0.25 * (statistics[2] - 0.4), 0.0, 0.0])


def planted_scene(number: int) -> PriorScene:
    """A scene whose loss has its minimum at k = 1 and α = α*, the planted best, in every row."""
    random = np.random.default_rng(number)
    vpl_count = np.repeat(np.array(COUNTS, np.int32), 4)
    fitted = np.tile([True, True, False, False], len(COUNTS))
    statistics = random.uniform(0.2, 0.6, (len(vpl_count), len(STATISTIC_NAMES))).astype(np.float32)
    statistics[:, 2] = random.uniform(0.0, 0.8)
    shape = (len(vpl_count), len(FOOTPRINT_PLACES), len(BIAS_PLACES), len(SOFTNESS_PLACES))
    offset = np.array([planted_best(row)[1] for row in statistics])[:, None] - np.array(FOOTPRINT_PLACES)
    bowl = 1.05 + 40.0 * offset**2
    square = np.broadcast_to(1.0 / bowl[..., None, None], shape).astype(np.float32)
    # A k² − B k + C with A = 1/bowl, B = 2/bowl, C = 1 has its minimum 1 − 1/bowl at k = 1.
    constant = np.ones(len(vpl_count), np.float32)
    table = LossTable(square, 2.0 * square, constant)
    return PriorScene(f"planted-{number}", statistics, table, table, vpl_count, fitted)


@pytest.fixture(scope="module")
def scenes() -> tuple[PriorScene, ...]:
    return tuple(planted_scene(number) for number in range(SCENES))


def test_own_fits_find_the_planted_best(scenes):
    fits = own_fits(scenes)
    assert fits.vpl_counts == COUNTS
    for scene, points in zip(scenes, fits.points, strict=True):
        best = np.clip(planted_best(scene.statistics[0])[1], LOWEST_POINT[1], None)
        np.testing.assert_allclose(points[:, 1], best, atol=0.02)
        np.testing.assert_allclose(points[:, 0], DEFAULT[0], atol=0.02)


def test_a_prior_learns_what_follows(scenes):
    """On unseen scenes it removes 90 % of the excess loss of the defaults over the scenes' own fits."""
    rows = training_rows(scenes, own_fits(scenes))
    left_out = np.arange(SCENES) % 2 == np.arange(2)[:, None]
    priors = train(rows, left_out)
    scene = np.asarray(rows.scene)
    points = np.array(
        [
            priors[s % 2].point(row.astype(np.float64))
            for s, row in zip(scene, np.asarray(rows.statistics), strict=True)
        ],
        np.float32,
    )
    lost = np.asarray(row_losses(rows, points)) - np.asarray(rows.fit_loss)
    default = np.asarray(rows.default_loss) - np.asarray(rows.fit_loss)
    assert lost.mean() < 0.1 * default.mean()


def test_what_is_left_out_is_not_seen(scenes):
    """Replacing a left-out scene's tables by others does not change the prior."""
    left_out = np.zeros((1, SCENES), bool)
    left_out[0, 3] = True
    turned = jax.tree.map(lambda values: values[:, ::-1] if values.ndim > 1 else values, scenes[3].table)
    other = (*scenes[:3], dataclasses.replace(scenes[3], table=turned, relmse_table=turned), *scenes[4:])
    first, second = (train(training_rows(each, own_fits(each)), left_out)[0] for each in (scenes, other))
    np.testing.assert_allclose(np.array(first.weights), np.array(second.weights), rtol=1e-4, atol=1e-6)
