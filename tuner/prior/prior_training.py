"""Trains a prior on the loss tables of many scenes at once, end to end through the surrogate's loss.

The prior's point for a view goes into the view's tables, and what is minimised is the mean over scenes, VPL
counts, views and both measures, the loss that fits have and relMSE alone, of

    log((loss + ε)/(loss of the scene's own fit + ε)),

so that no scene outweighs another, plus what is lost against the defaults where anything is, a pull towards
them and a weight decay. Two measures, since a fit's loss lets relMSE rise where dark pixels leak: trained
by that loss alone, a prior was worse than the defaults, by relMSE, on up to twice as many new scenes. Twin of
the model: `renderer.config.auto_prior.AutoPrior`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Float32, Int32

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
LEARNING_RATE = 0.02
REACH = np.array([0.06, 0.15, 0.2, 0.2], np.float32)
"""How far along its axis each of `AUTO_PARAMETERS` goes, roughly: the unit of weights and pull."""
WEIGHT_DECAY = 0.03
"""Of the summed squared weights: few scenes must not be learnt by heart."""
PULL = 0.01
"""Of the squared distance from the defaults."""
CAUTION = 3.0
"""Weight of what a view loses against the defaults, beside what it loses against its fit. 1 comes a little
closer to fits, and is worse than the defaults on more scenes."""
FLOOR = 0.01
"""ε: below it, what differs between two losses is mostly the references' noise."""
FOLDS = 8
"""Trained at once, where scenes are left out in turn."""

DEFAULT = default_point(ArtistParameters())
_SIZE = HIGHEST_POINT - LOWEST_POINT
Weights = dict[str, Array]
"""`weights` [parameters, statistics] and `bias` [parameters], both in units of `REACH`."""

_each = jax.vmap(jax.vmap(table_loss), in_axes=(0, None))
"""Losses by both measures of many views, each at its own point."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TrainingRows:
    """All scenes' captures one below the other."""

    statistics: Float[Array, "rows statistics"]
    table: LossTable
    """Of both measures, each with all rows: the fit's loss, then relMSE."""
    fit_loss: Float[Array, "measures rows"]
    """Of the scene's own fit at that VPL count, at this view."""
    default_loss: Float[Array, "measures rows"]
    weight: Float[Array, " rows"]
    """Sums to 1 over all rows; the same for each scene, and within it for each VPL count."""
    scene: Int32[Array, " rows"]


@dataclass(frozen=True, eq=False)
class OwnFits:
    """What each scene's fit at each VPL count comes to: the best that a prior could do for it."""

    vpl_counts: tuple[int, ...]
    points: Float32[np.ndarray, "scenes counts parameters"]


def own_fits(scenes: tuple[PriorScene, ...], held_out: bool = False) -> OwnFits:
    """Each scene fitted by itself at each VPL count, over all rotations at once, to its fitted views.

    `held_out` fits to the other views in their stead: what a fit of these could have come to.
    """
    counts = tuple(int(count) for count in np.unique(scenes[0].vpl_count))
    points = [[_fitted_point(_rows(scene, count, not held_out)) for count in counts] for scene in scenes]
    return OwnFits(counts, np.array(points))


def _rows(scene: PriorScene, vpl_count: int, fitted: bool) -> LossTable:
    """What the scene's own fit at that VPL count may see."""
    rows = (scene.fitted == fitted) & (scene.vpl_count == vpl_count)
    return jax.tree.map(lambda values: jnp.asarray(values[rows]), scene.table)


def _joined(tables: Iterable[LossTable]) -> LossTable:
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *tables)


def training_rows(scenes: tuple[PriorScene, ...], fits: OwnFits) -> TrainingRows:
    """The rows of all scenes, with what their own fits come to."""
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
    """A prior for each fold, which has not seen the scenes that are left out there."""
    statistics = np.asarray(rows.statistics)
    center, spread = statistics.mean(axis=0), statistics.std(axis=0) + 1e-3
    normalised = jnp.asarray((statistics - center) / spread)
    weights = jax.lax.map(
        lambda out: _trained(rows, out, normalised), jnp.asarray(left_out), batch_size=FOLDS
    )
    return tuple(
        _folded(jax.tree.map(lambda values, i=i: np.asarray(values[i], np.float64), weights), center, spread)
        for i in range(len(left_out))
    )


def prior_points(
    weights: Weights, statistics: Float[Array, "rows statistics"]
) -> Float[Array, "rows parameters"]:
    """The model, before it is kept in its ranges; statistics have mean 0 and deviation 1."""
    return DEFAULT + REACH * (statistics @ weights["weights"].T + weights["bias"])


def _objective(
    weights: Weights, rows: TrainingRows, share: Array, statistics: Float[Array, "rows statistics"]
) -> Float[Array, ""]:
    free = prior_points(weights, statistics)
    # Clamped in value but not in gradient: a parameter that has left its range can still come back.
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
    # The start is the defaults everywhere.
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
    """With normalisation, reach and defaults taken into weights and bias."""
    slopes = REACH[:, None] * weights["weights"] / spread
    bias = DEFAULT + REACH * weights["bias"] - slopes @ center

    def rows(*vectors: np.ndarray) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(float(value) for value in vector) for vector in vectors)

    return AutoPrior(rows(*slopes), *rows(bias, LOWEST_POINT, HIGHEST_POINT))


def _fitted_point(table: LossTable) -> Float32[np.ndarray, " parameters"]:
    """The best of the descents from the defaults and from softer starts, over all rows of one scene."""
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
    """The loss of every row by both measures, each at its point."""
    return _each(rows.table, points)
