"""Gradient descent in the unit cube on any differentiable loss: what a fit runs.

It knows nothing of light. Adam (Kingma and Ba 2015) with a cosine schedule, each step projected back into
the cube; steps with a gradient that is not finite are passed over (`optax.apply_if_finite`).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from tuner.fit_status import Descent, FitStatus

STEPS = 200
LEARNING_RATE = 0.08
"""Of the cube's side in the first steps: any point can be reached from any other within about twenty."""
BLOCK = 20
"""Steps compiled into one scan; between blocks the descent reports progress and can be interrupted."""
SETTLED = 1e-5
"""Relative fall of the best loss over a block below which it counts as settled."""
_MAX_BAD_GRADIENTS = 1000

Data = TypeVar("Data")


def descend(
    loss: Callable[[Float[Array, "parameters"], Data], Float[Array, ""]],
    data: Data,
    start: Float[np.ndarray, "parameters"],
    *,
    steps: int = STEPS,
    progress: Callable[[float], None] | None = None,
) -> Descent:
    """Minimise `loss(point, data)` over the unit cube.

    Args:
        loss: pure and differentiable in its first argument; compiled once for each shape of `data`.
        data: a pytree handed to `loss` as it is.
        start: where to begin; also the floor under the result, which is never worse.
        steps: at most this many, in whole blocks of `BLOCK`.
        progress: called with the share of steps done, in [0, 1].
    """
    optimizer = _optimizer(steps)
    point = jnp.asarray(np.clip(start, 0.0, 1.0), jnp.float32)
    start_loss = float(jax.jit(loss)(point, data))
    best = (point, jnp.float32(start_loss))
    if not np.isfinite(start_loss):
        return Descent(
            np.asarray(point), start_loss, start_loss, np.array([start_loss]), FitStatus.NOT_FINITE
        )
    state, losses, status = optimizer.init(point), [np.array([start_loss])], FitStatus.STEP_LIMIT
    blocks = -(-steps // BLOCK)
    for block in range(blocks):
        before = float(best[1])
        point, state, best, trace = _block(loss, steps, point, state, best, data)
        losses.append(np.asarray(trace))
        if progress is not None:
            progress((block + 1) / blocks)
        # In the schedule's last third steps are small enough for a pause to mean that it is over.
        if block >= 2 * blocks // 3 and before - float(best[1]) <= SETTLED * abs(before):
            status = FitStatus.CONVERGED
            break
    if not float(best[1]) < start_loss:
        status = FitStatus.NO_IMPROVEMENT
    return Descent(np.asarray(best[0]), float(best[1]), start_loss, np.concatenate(losses), status)


def _optimizer(steps: int) -> optax.GradientTransformation:
    schedule = optax.cosine_decay_schedule(LEARNING_RATE, -(-steps // BLOCK) * BLOCK, alpha=0.01)
    return optax.apply_if_finite(optax.adam(schedule, b1=0.8, b2=0.95), _MAX_BAD_GRADIENTS)


@partial(jax.jit, static_argnums=(0, 1))
def _block(
    loss: Callable[..., Array], steps: int, point: Array, state: Any, best: tuple[Array, Array], data: Any
) -> tuple[Array, Any, tuple[Array, Array], Array]:
    optimizer = _optimizer(steps)

    def step(carry: tuple[Array, Any, tuple[Array, Array]], _: None) -> tuple[Any, Array]:
        point, state, (best_point, best_loss) = carry
        value, gradient = jax.value_and_grad(loss)(point, data)
        better = value < best_loss
        best = (jnp.where(better, point, best_point), jnp.where(better, value, best_loss))
        updates, state = optimizer.update(gradient, state, point)
        point = jnp.clip(optax.apply_updates(point, updates), 0.0, 1.0)
        return (point, state, best), value

    (point, state, best), losses = jax.lax.scan(step, (point, state, best), None, length=BLOCK)
    return point, state, best, losses
