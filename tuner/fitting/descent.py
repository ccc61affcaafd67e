"""Least squares in the unit cube, for any differentiable residuals: what a fit runs.

It knows nothing of light. Levenberg (1944) and Marquardt (1963): with J the Jacobian of the residuals r,
a step s solves (JᵀJ + μ·max λ(JᵀJ)) s = −Jᵀr over the axes that are free, those along which the descent does
not leave the cube. A step that does not lower the sum of squares, or is not finite, is taken back and damped
more. On 15 scenes, from 64 random points each, all but two of the points came within 0.1 % of the least loss
known (`vpltune bench descent`).
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
BLOCK = 4
"""Steps compiled into one scan; between blocks the descent reports progress and can be interrupted."""
SETTLED = 1e-6
"""Relative fall of the sum of squares over a block below which it counts as settled."""
LONGEST_STEP = 0.3
"""Of the cube's side, along any axis."""
FIRST_DAMPING = 1e-2
PROFILE_STEPS = 12
_LEAST_DAMPING, _MOST_DAMPING = 1e-7, 1e7
_NARROWING, _WIDENING = 0.1, 10.0

Data = TypeVar("Data")
Residuals = Callable[[Float[Array, " parameters"], Data], Float[Array, "..."]]


class _Linearised(NamedTuple):
    """The sum of squared residuals at a point, with half its gradient and half its Gauss-Newton Hessian."""

    squares: Array
    slope: Array
    curvature: Array


class _State(NamedTuple):
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
        residuals: pure and differentiable in its first argument; compiled once for each shape of `data`.
        data: a pytree handed to `residuals` as it is.
        start: where to begin; also the floor under the result, which is never worse.
        offset: added to the sum of squares in what is reported as the loss.
        steps: at most this many, in whole blocks of `BLOCK`.
        progress: called with the share of steps done, in [0, 1].
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
    """The least Σ residuals² with one parameter held at each of `places`, and those that are `free` at their
    best; the rest stays at `start`."""
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
    """Forward mode: a handful of parameters, and nothing of the residuals' making is kept."""

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
    """The damped Gauss-Newton step over the free axes, no longer than LONGEST_STEP."""
    held = ((point <= 0.0) & (at.slope > 0.0)) | ((point >= 1.0) & (at.slope < 0.0))
    if free is not None:
        held |= ~free
    slope = jnp.where(held, 0.0, at.slope)
    curvature = jnp.where(held[:, None] | held[None, :], 0.0, at.curvature)
    values, vectors = jnp.linalg.eigh(curvature)
    # 1e-30: nothing that can be moved changes anything, and the step is zero by zero.
    damped = jnp.maximum(values, 0.0) + damping * jnp.maximum(values[-1], 1e-30)
    step = -vectors @ ((vectors.T @ slope) / damped)
    return step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(jnp.abs(step).max(), LONGEST_STEP))


def _improve(
    residuals: Residuals, data: Any, free: Array | None, state: _State, _: None
) -> tuple[_State, Array]:
    """One step of the scan: taken if it lowers the sum of squares."""
    point = state.point + _step(state.at_point, state.point, state.damping, free)
    point = optax.projections.projection_box(point, 0.0, 1.0)
    tried = _linearise(residuals, point, data)
    # A comparison with NaN is false; an infinite slope beside a finite value would be one step later.
    finite = jnp.isfinite(tried.slope).all() & jnp.isfinite(tried.curvature).all()
    better = (tried.squares < state.at_point.squares) & finite
    damping = jnp.clip(
        state.damping * jnp.where(better, _NARROWING, _WIDENING), _LEAST_DAMPING, _MOST_DAMPING
    )
    kept = jax.tree.map(partial(jnp.where, better), (point, tried), (state.point, state.at_point))
    return _State(*kept, damping), kept[1].squares


@partial(jax.jit, static_argnums=0)
def _block(residuals: Residuals, state: _State, data: Any) -> tuple[_State, Array]:
    return jax.lax.scan(partial(_improve, residuals, data, None), state, None, length=BLOCK)
