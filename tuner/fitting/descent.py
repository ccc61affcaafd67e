"""Nonlinear least squares in the unit cube, for any differentiable residuals.

This module knows nothing of light. It implements Levenberg (1944) and Marquardt (1963): with J the Jacobian
of the residuals r and λ_max the largest eigenvalue of JᵀJ, a step s solves (JᵀJ + μ·λ_max·I) s = −Jᵀr. An
axis at a bound is held if the step would leave the cube along it. A step that does not lower the sum of
squares, or gives a value that is not finite, is rejected and the damping μ is raised.

On 15 scenes, from 64 random points each, all but two of the points came within 0.1 % of the least loss known
(`vpltune bench descent`).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float

from vpltune.tuner.fitting.fit_status import Descent, FitStatus

STEPS = 40
"""Default limit on the steps of a descent. A choice."""
BLOCK = 4
"""Steps compiled into one scan. Progress is reported, and Ctrl-C takes effect, between blocks. A choice."""
SETTLED = 1e-6
"""The descent has converged when a block lowers the sum of squares by less than this share. A choice."""
LONGEST_STEP = 0.3
"""Longest step along any axis, as a share of the cube's side. A choice."""
FIRST_DAMPING = 1e-2
"""μ of the first step. A choice."""
PROFILE_STEPS = 12
"""Steps at each place of a profile. A choice."""
_LEAST_DAMPING, _MOST_DAMPING = 1e-7, 1e7
"""Bounds of μ. A choice."""
_NARROWING, _WIDENING = 0.1, 10.0
"""Factors of μ after an accepted and after a rejected step. A choice."""

Data = TypeVar("Data")
Residuals = Callable[[Float[Array, " parameters"], Data], Float[Array, "..."]]
"""Residuals as a function of a point of the unit cube and of data."""


class _Linearised(NamedTuple):
    """Normal equations at a point: rᵀr, Jᵀr [parameters] and JᵀJ [parameters, parameters]."""

    squares: Array
    slope: Array
    curvature: Array


class _State(NamedTuple):
    """The best point so far [parameters], its normal equations, and μ."""

    point: Array
    at_point: _Linearised
    damping: Array


def descend(
    residuals: Residuals,
    data: Data,
    start: Float[np.ndarray, " parameters"],
    *,
    offset: float = 0.0,
    steps: int = STEPS,
    progress: Callable[[float], None] | None = None,
) -> Descent:
    """Minimise Σ residuals(point, data)² over the unit cube.

    Args:
        residuals: pure, and differentiable in its first argument; compiled once for each shape of `data`.
        data: a pytree that is passed to `residuals` unchanged.
        start: the first point, clipped to the cube. The result is never worse.
        offset: added to the sum of squares in every reported loss.
        steps: limit on the steps, rounded up to whole blocks of `BLOCK`.
        progress: called with the share of steps done, in [0, 1].

    Returns:
        The best point met. Its status is `NOT_FINITE` if the loss at the start is not finite.
    """
    point = jnp.asarray(np.clip(start, 0.0, 1.0), jnp.float32)
    state = _State(point, _first(residuals, point, data), jnp.float32(FIRST_DAMPING))
    squares = [np.asarray(state.at_point.squares)[None]]
    start_squares = float(squares[0][0])
    status = FitStatus.STEP_LIMIT if np.isfinite(start_squares) else FitStatus.NOT_FINITE
    blocks = -(-steps // BLOCK) if np.isfinite(start_squares) and point.size else 0
    for block in range(blocks):
        state, trace = _block(residuals, state, data)
        squares.append(np.asarray(trace))
        if progress is not None:
            progress((block + 1) / blocks)
        if float(squares[-2][-1]) - float(trace[-1]) <= SETTLED * float(trace[-1]):
            status = FitStatus.CONVERGED
            break
    losses = np.concatenate(squares).astype(np.float64) + offset
    if status is not FitStatus.NOT_FINITE and not losses[-1] < losses[0]:
        status = FitStatus.NO_IMPROVEMENT
    return Descent(np.asarray(state.point), float(losses[-1]), float(losses[0]), losses, status)


def profile(
    residuals: Residuals,
    data: Data,
    start: Float[np.ndarray, " parameters"],
    axis: int,
    places: Float[np.ndarray, " places"],
    free: Bool[np.ndarray, " parameters"],
) -> Float[np.ndarray, " places"]:
    """Profile of Σ residuals² along one axis.

    Args:
        residuals, data: as in `descend`.
        start: values of the parameters that are neither `free` nor `axis`, and where the free ones begin.
        axis: index of the parameter that is held at each of `places`.
        places: values of that parameter, in [0, 1].
        free: which of the other parameters are optimised, by `PROFILE_STEPS` steps at each place.

    Returns:
        The least sum of squares found at each place.
    """
    free = free & (np.arange(len(start)) != axis)
    squares = _profile(
        residuals, data, jnp.asarray(start, jnp.float32), axis, jnp.asarray(places, jnp.float32), free
    )
    return np.asarray(squares, np.float64)


@partial(jax.jit, static_argnums=0)
def _profile(residuals: Residuals, data: Any, start: Array, axis: Array, places: Array, free: Array) -> Array:
    held = jnp.arange(start.shape[0]) == axis

    def least(place: Array) -> Array:
        point = jnp.where(held, place, start)
        state = _State(point, _linearise(residuals, point, data), jnp.float32(FIRST_DAMPING))
        state, _ = jax.lax.scan(partial(_improve, residuals, data, free), state, None, length=PROFILE_STEPS)
        return state.at_point.squares

    return jax.vmap(least)(places)


def _linearise(residuals: Residuals, point: Array, data: Any) -> _Linearised:
    """Evaluate the residuals and their Jacobian at a point.

    Forward mode, because there are few parameters and it stores no intermediate values.
    """

    def flat(at: Array) -> tuple[Array, Array]:
        values = residuals(at, data).ravel()
        return values, values

    jacobian, values = jax.jacfwd(flat, has_aux=True)(point)
    product = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)
    return _Linearised(product(values, values), product(jacobian.T, values), product(jacobian.T, jacobian))


@partial(jax.jit, static_argnums=0)
def _first(residuals: Residuals, point: Array, data: Any) -> _Linearised:
    return _linearise(residuals, point, data)


def _step(at: _Linearised, point: Array, damping: Array, free: Array | None = None) -> Array:
    """The damped Gauss-Newton step over the free axes, at most `LONGEST_STEP` along any of them."""
    held = ((point <= 0.0) & (at.slope > 0.0)) | ((point >= 1.0) & (at.slope < 0.0))
    if free is not None:
        held |= ~free
    slope = jnp.where(held, 0.0, at.slope)
    curvature = jnp.where(held[:, None] | held[None, :], 0.0, at.curvature)
    values, vectors = jnp.linalg.eigh(curvature)
    # 1e-30: if no free axis changes the residuals, the step is 0 and not 0/0.
    damped = jnp.maximum(values, 0.0) + damping * jnp.maximum(values[-1], 1e-30)
    step = -vectors @ ((vectors.T @ slope) / damped)
    return step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(jnp.abs(step).max(), LONGEST_STEP))


def _improve(
    residuals: Residuals, data: Any, free: Array | None, state: _State, _: None
) -> tuple[_State, Array]:
    """One step of the scan, accepted if it lowers the sum of squares."""
    point = state.point + _step(state.at_point, state.point, state.damping, free)
    point = optax.projections.projection_box(point, 0.0, 1.0)
    tried = _linearise(residuals, point, data)
    # A comparison with NaN is false. An infinite derivative of a finite value would spoil the next step.
    finite = jnp.isfinite(tried.slope).all() & jnp.isfinite(tried.curvature).all()
    better = (tried.squares < state.at_point.squares) & finite
    damping = jnp.clip(
        state.damping * jnp.where(better, _NARROWING, _WIDENING), _LEAST_DAMPING, _MOST_DAMPING
    )
    kept, at_kept = jax.tree.map(partial(jnp.where, better), (point, tried), (state.point, state.at_point))
    return _State(kept, at_kept, damping), at_kept.squares


@partial(jax.jit, static_argnums=0)
def _block(residuals: Residuals, state: _State, data: Any) -> tuple[_State, Array]:
    return jax.lax.scan(partial(_improve, residuals, data, None), state, None, length=BLOCK)
