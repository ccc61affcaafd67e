"""Train a prior on the loss tables of many scenes at once, end to end through the surrogate's loss.

The tables of a view give its loss at the point that the prior predicts for it. The objective is the mean over
scenes, VPL counts, views and two measures (the robust loss of a fit, and relMSE) of

    log((loss + ε)/(loss of the scene's own fit + ε)),

so that all scenes have the same weight. To it are added a penalty where the prior is worse than the defaults,
a pull towards the defaults, and weight decay. There are two measures because the loss of a fit tolerates a
higher relMSE where light leaks into dark pixels: a prior trained by that loss alone was worse than the
defaults, by relMSE, on up to twice as many new scenes. Twin of the model:
`renderer.config.auto_prior.AutoPrior`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Float32, Float64, Int32

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.auto_prior import AutoPrior
from vpltune.tuner.fitting.descent import descend
from vpltune.tuner.prior.loss_table import (
    HIGHEST_POINT,
    LOWEST_POINT,
    LossTable,
    default_point,
    table_loss,
    table_residuals,
)
from vpltune.tuner.prior.prior_library import PriorScene

STEPS = 300
"""Steps of Adam in the training. A choice."""
LEARNING_RATE = 0.02
"""Initial learning rate of the training. A choice."""
REACH = np.array([0.06, 0.15, 0.2, 0.2], np.float32)
"""Typical range of each of `AUTO_PARAMETERS` along its axis, the unit of weights and pull. A choice."""
WEIGHT_DECAY = 0.03
"""Factor on the sum of the squared weights. A choice: it prevents overfitting to few scenes."""
PULL = 0.01
"""Factor on the squared distance from the defaults. A choice."""
CAUTION = 3.0
"""Weight of the loss relative to the defaults against the loss relative to the fit. A choice: 1 comes
slightly closer to the fits but is worse than the defaults on more scenes."""
FLOOR = 0.01
"""ε. A choice: below it, two losses differ mostly by the noise of the references."""
FOLDS = 8
"""Groups of the cross-validation, which are trained in parallel. A choice."""

DEFAULT = default_point(ArtistParameters())
"""The point of the default parameters in the unit cube."""
_SIZE = HIGHEST_POINT - LOWEST_POINT
Weights = dict[str, Array]
"""`weights` [parameters, statistics] and `bias` [parameters], both in units of `REACH`."""

_each = jax.vmap(jax.vmap(table_loss), in_axes=(0, None))
"""Losses [measures, rows] of many views by both measures, each at its own point."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TrainingRows:
    """The captures of all scenes, concatenated. The measures are the robust loss of a fit, then relMSE."""

    statistics: Float[Array, "rows statistics"]
    table: LossTable
    """Tables [measures, rows, …]."""
    fit_loss: Float[Array, "measures rows"]
    """Loss of the scene's own fit at that VPL count, in this view."""
    default_loss: Float[Array, "measures rows"]
    """Loss of the default parameters in this view."""
    weight: Float[Array, " rows"]
    """Weights that sum to 1. All scenes have the same weight, and all VPL counts within a scene."""
    scene: Int32[Array, " rows"]
    """Index of the scene."""


@dataclass(frozen=True, eq=False)
class OwnFits:
    """The fit of each scene by itself at each VPL count: the best that a prior can reach on fitted views."""

    vpl_counts: tuple[int, ...]
    points: Float32[np.ndarray, "scenes counts parameters"]
    """Points in the unit cube."""


@dataclass(frozen=True, eq=False)
class LearntPrior:
    """A prior trained on all scenes, and for each scene a prior trained without it."""

    scenes: tuple[PriorScene, ...]
    fits: OwnFits
    prior: AutoPrior
    """Trained on all scenes."""
    losses: dict[str, Float64[np.ndarray, "measures scenes counts splits"]]
    """Mean losses of `auto` (the prior of the fold that leaves the scene out), `fit` (the scene's own fit)
    and `default`. The measures are the robust loss of a fit and relMSE; the splits are fitted and held-out
    views."""


def own_fits(scenes: tuple[PriorScene, ...]) -> OwnFits:
    """Fit each scene by itself at each VPL count, to its fitted views in all rotations."""
    counts = tuple(int(count) for count in np.unique(scenes[0].vpl_count))
    points = [[_fitted_point(_rows(scene, count)) for count in counts] for scene in scenes]
    return OwnFits(counts, np.array(points))


def _rows(scene: PriorScene, vpl_count: int) -> LossTable:
    """The tables of the fitted views of a scene at one VPL count."""
    rows = scene.fitted & (scene.vpl_count == vpl_count)
    return jax.tree.map(lambda values: jnp.asarray(values[rows]), scene.table)


def _joined(tables: Iterable[LossTable]) -> LossTable:
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *tables)


def training_rows(scenes: tuple[PriorScene, ...], fits: OwnFits) -> TrainingRows:
    """The captures of all scenes, with the losses of the scenes' own fits and of the defaults."""
    measures = (_joined(scene.table for scene in scenes), _joined(scene.relmse_table for scene in scenes))
    table = jax.tree.map(lambda *tables: jnp.stack(tables), *measures)
    scene = np.concatenate([np.full(len(s.vpl_count), i, np.int32) for i, s in enumerate(scenes)])
    counts = np.concatenate([s.vpl_count for s in scenes])
    which = np.searchsorted(np.array(fits.vpl_counts), counts)
    fit_loss = jax.jit(_each)(table, jnp.asarray(fits.points[scene, which]))
    group = scene * len(fits.vpl_counts) + which
    weight = 1.0 / np.bincount(group)[group]
    return TrainingRows(
        jnp.asarray(np.concatenate([s.statistics for s in scenes])),
        table,
        fit_loss,
        jax.jit(_each)(table, jnp.broadcast_to(DEFAULT, (len(scene), len(DEFAULT)))),
        jnp.asarray(weight / weight.sum(), jnp.float32),
        jnp.asarray(scene),
    )


def train(rows: TrainingRows, left_out: Bool[np.ndarray, "folds scenes"]) -> tuple[AutoPrior, ...]:
    """Train a prior for each fold, without the scenes that are left out of it."""
    statistics = np.asarray(rows.statistics)
    center, spread = statistics.mean(axis=0), statistics.std(axis=0) + 1e-3
    normalised = jnp.asarray((statistics - center) / spread)
    weights = jax.lax.map(
        lambda out: _trained(rows, out, normalised), jnp.asarray(left_out), batch_size=FOLDS
    )
    return tuple(
        _folded({name: np.asarray(values[i], np.float64) for name, values in weights.items()}, center, spread)
        for i in range(len(left_out))
    )


def prior_points(
    weights: Weights, statistics: Float[Array, "rows statistics"]
) -> Float[Array, "rows parameters"]:
    """The model before clamping: points in the unit cube, from statistics with mean 0 and deviation 1."""
    return (statistics @ weights["weights"].T + weights["bias"]) * REACH + DEFAULT


def _objective(
    weights: Weights, rows: TrainingRows, share: Array, statistics: Float[Array, "rows statistics"]
) -> Float[Array, ""]:
    free = prior_points(weights, statistics)
    # Clamp the value but not the gradient, so that a parameter outside its range can still return.
    points = free + jax.lax.stop_gradient(jnp.clip(free, LOWEST_POINT, HIGHEST_POINT) - free)

    def level(losses: Array) -> Array:
        return jnp.log(jnp.maximum(losses, 0.0) + FLOOR)

    found = level(_each(rows.table, points))
    over_fit = found - level(rows.fit_loss)
    over_default = jnp.maximum(found - level(rows.default_loss), 0.0)
    pull = jnp.sum(((free - DEFAULT) / REACH) ** 2, axis=1)
    outside = jnp.sum(((free - points) / REACH) ** 2, axis=1)
    decay = jnp.sum(weights["weights"] ** 2)
    lost = (over_fit + CAUTION * over_default).mean(axis=0)
    return jnp.sum(share * (lost + PULL * pull + outside)) + WEIGHT_DECAY * decay


@jax.jit
def _trained(
    rows: TrainingRows, left_out: Bool[Array, " scenes"], statistics: Float[Array, "rows statistics"]
) -> Weights:
    share = jnp.where(left_out[rows.scene], 0.0, rows.weight)
    share = share / share.sum()
    # The initial prior predicts the defaults everywhere.
    start = {"weights": jnp.zeros((len(REACH), statistics.shape[1])), "bias": jnp.zeros(len(REACH))}
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, STEPS))

    def step(carry: tuple[Any, Any], _: None) -> tuple[Any, None]:
        weights, state = carry
        gradient = jax.grad(_objective)(weights, rows, share, statistics)
        updates, state = optimizer.update(gradient, state, weights)
        return (optax.apply_updates(weights, updates), state), None

    (weights, _), _ = jax.lax.scan(step, (start, optimizer.init(start)), None, length=STEPS)
    return weights


def _folded(weights: dict[str, np.ndarray], center: np.ndarray, spread: np.ndarray) -> AutoPrior:
    """The prior with normalisation, reach and defaults folded into weights and bias."""
    slopes = REACH[:, None] * weights["weights"] / spread
    bias = DEFAULT + REACH * weights["bias"] - slopes @ center

    def rows(*vectors: np.ndarray) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(float(value) for value in vector) for vector in vectors)

    return AutoPrior(rows(*slopes), *rows(bias, LOWEST_POINT, HIGHEST_POINT))


def _fitted_point(table: LossTable) -> Float32[np.ndarray, " parameters"]:
    """The best of three descents over a scene's rows, from the defaults and from two shifted starts."""
    moves = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.15, 0.3, 0.1], [0.0, 0.0, -0.2, -0.3]])
    starts = np.clip((DEFAULT + moves - LOWEST_POINT) / _SIZE, 0.0, 1.0)
    found = [descend(_residuals, table, start) for start in starts]
    # `descend` is never worse than its start, so a fit is never worse than the defaults.
    best = min(found, key=lambda descent: descent.loss)
    return (LOWEST_POINT + best.point * _SIZE).astype(np.float32)


def _residuals(place: Float[Array, " parameters"], table: LossTable) -> Float[Array, "rows residuals"]:
    """At `place` in the unit cube of the tabulated part."""
    rows = jax.vmap(table_residuals, in_axes=(0, None))(table, LOWEST_POINT + place * _SIZE)
    return rows / np.sqrt(rows.shape[0])


@jax.jit
def row_losses(rows: TrainingRows, points: Float[Array, "rows parameters"]) -> Float[Array, "measures rows"]:
    """The loss of every row by both measures, each at its own point in the unit cube."""
    return _each(rows.table, points)
