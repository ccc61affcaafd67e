"""Fits intensity and falloff to a loss of the user's own: any differentiable function of irradiance.

The loss of the views is a function of a point of the unit cube, by way of the gather tabulated over α and κ
(`tuner.surrogate.tabulated_gather`). L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995) minimises it within the cube
by its value and gradient. Unlike `tuner.fitting.descent`, it needs no residuals. It knows the bounds, where
fits often begin: κ = 0 is the default.

A loss may have several minima, most of all along α, and be flat far from them. So a descent begins at the
start, and one at the best point of a coarse grid for each of its places of α; the best end counts.

All is computed in double precision, which takes milliseconds: the minimum lies in a narrow valley, along
which single precision of the loss stops the line search far too early.

k, α and κ are fitted. Placement and visibility maps stay as they are: the first is no smooth function of its
parameters, and the loss is almost flat in the second in most scenes (`tuner.fitting.fit_visibility`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.errors import InputError
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.fitting.fit_views import RECEIVERS_PER_VIEW, view_pixels
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.tabulated_gather import TabulatedGather, gather_tabulated
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters

Loss = Callable[[Float[Array, "receivers 3"], Float[Array, "receivers 3"]], Float[Array, ""]]
"""Loss of one view, as a function of its indirect irradiance, predicted and by the reference [W/m²]."""
LossView = tuple[TabulatedGather, Float[Array, "receivers 3"]]
"""The tabulated gather of one view, and its reference [W/m²] at the same receivers."""

ITERATIONS = 100
"""Limit on the iterations of a descent. A choice: planted problems took at most 46."""
GRID = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Places of the grid's points along each axis of the cube. A choice."""
_SETTLED = 1e-12
"""Least fall of the loss in an iteration, in units of the gradient at the start. A choice, above the rounding
of double precision."""
_FLAT = 1e-8
"""Largest gradient at a minimum, relative to that at the start. A choice."""

_SPACE = SearchSpace()


def fit_own_loss(
    views: Sequence[CapturedView],
    start: ArtistParameters,
    loss: Loss,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[ArtistParameters, Descent]:
    """Minimise the mean of `loss` over the views.

    Args:
        views: captured with the placement of `start`; at least one.
        start: where the fit begins, and the values of all parameters but k, α and κ.
        loss: traced by JAX, so written with `jax.numpy`.
        seed: selects the pixels of each view.
        progress: called with the share done, in [0, 1].

    Raises:
        InputError: the loss is not one number, not finite, or cannot be traced.
    """
    ready = [
        (
            view_pixels(view, seed=seed).table(start),
            jnp.asarray(view.pixel_values(RECEIVERS_PER_VIEW, seed).reference),
        )
        for view in views
    ]
    return minimise_loss(ready, start, loss, progress=progress)


def minimise_loss(
    views: Sequence[LossView],
    start: ArtistParameters,
    loss: Loss,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[ArtistParameters, Descent]:
    """As `fit_own_loss`, with the views' tables and references."""
    data = tuple(views)
    _require_one_number(loss, data[0][1])
    first = _SPACE.point(start)
    evaluated = _Evaluated(loss, data, first)
    descents = []
    places = [first, *_promising(loss, data)]
    for place in places:
        descents.append(_descended(evaluated, place))
        progress(len(descents) / len(places))
    best, start_loss = min(descents, key=lambda each: each.loss), descents[0].start_loss
    if not best.loss < start_loss:
        return start, Descent(first, start_loss, start_loss, descents[0].losses, FitStatus.NO_IMPROVEMENT)
    return _SPACE.parameters(best.point, start), replace(best, start_loss=start_loss)


def _promising(loss: Loss, data: tuple[LossView, ...]) -> Iterator[Float[np.ndarray, " axes"]]:
    """The best point of the grid for each of its places of α."""
    count = len(_SPACE.specs)
    grid = np.stack(np.meshgrid(*[GRID] * count, indexing="ij"), axis=-1).reshape(-1, count)
    with jax.enable_x64(True):
        losses = np.asarray(_losses(loss, jnp.asarray(grid), data))
    for place in GRID:
        there = grid[:, _SPACE.names.index("falloff_footprint")] == place
        # A loss may be no number far from what it was written for: no descent begins there.
        if np.isfinite(losses[there]).any():
            yield grid[there][int(np.nanargmin(losses[there]))]


def loss_name(loss: Loss) -> str:
    """The name of a loss, for metrics.json."""
    return str(getattr(loss, "__qualname__", type(loss).__qualname__))


class _Evaluated:
    """Loss and gradient at points of the cube, in units of the gradient at the first point.

    L-BFGS-B stops by absolute differences where a loss is below 1; in these units they say the same of all.
    """

    def __init__(self, loss: Loss, data: tuple[LossView, ...], first: np.ndarray) -> None:
        self._loss, self._data = loss, data
        self.unit = 1.0
        _, gradient = self(first)
        self.unit = max(float(np.abs(gradient).max()), float(np.finfo(np.float32).tiny))

    def __call__(self, point: Float[np.ndarray, " axes"]) -> tuple[float, Float[np.ndarray, " axes"]]:
        with jax.enable_x64(True):
            value, gradient = _value_and_gradient(self._loss, jnp.asarray(point), self._data)
        value, gradient = float(value), np.asarray(gradient, np.float64)
        if not (np.isfinite(value) and np.isfinite(gradient).all()):
            there = _SPACE.parameters(point, ArtistParameters()).as_dict()
            where = ", ".join(f"{name} {there[name]:.4g}" for name in _SPACE.names)
            got = f"got {value:g}" if not np.isfinite(value) else f"got a gradient of {gradient.tolist()}"
            raise InputError(f"loss: must be finite and have a finite gradient, {got} at {where}")
        return value / self.unit, gradient / self.unit


def _descended(evaluated: _Evaluated, first: Float[np.ndarray, " axes"]) -> Descent:
    """The descent from one point; its losses are in the loss's own unit."""
    losses = [evaluated(first)[0]]

    def note(intermediate_result: Any) -> None:
        losses.append(float(intermediate_result.fun))

    found = minimize(
        evaluated,
        first,
        method="L-BFGS-B",
        jac=True,
        bounds=[(0.0, 1.0)] * len(first),
        callback=note,
        options={"maxiter": ITERATIONS, "ftol": _SETTLED, "gtol": _FLAT},
    )
    # Status 2 is a line search that ended in rounding, an end like another.
    status = FitStatus.STEP_LIMIT if found.status == 1 else FitStatus.CONVERGED
    curve = np.array(losses) * evaluated.unit
    return Descent(np.array(found.x), float(found.fun) * evaluated.unit, curve[0], curve, status)


def _mean_loss(loss: Loss, point: Float[Array, " axes"], data: tuple[LossView, ...]) -> Float[Array, ""]:
    falloff = FalloffParameters(**_SPACE.values(point))
    losses = [loss(gather_tabulated(table, falloff), reference) for table, reference in data]
    return jnp.mean(jnp.stack(losses))


@partial(jax.jit, static_argnums=0)
def _value_and_gradient(
    loss: Loss, point: Float[Array, " axes"], data: tuple[LossView, ...]
) -> tuple[Float[Array, ""], Float[Array, " axes"]]:
    return jax.value_and_grad(_mean_loss, argnums=1)(loss, point, data)


@partial(jax.jit, static_argnums=0)
def _losses(
    loss: Loss, points: Float[Array, "points axes"], data: tuple[LossView, ...]
) -> Float[Array, " points"]:
    return jax.lax.map(lambda point: _mean_loss(loss, point, data), points)


def _require_one_number(loss: Loss, reference: Float[Array, "receivers 3"]) -> None:
    try:
        value = jax.eval_shape(loss, reference, reference)
    except jax.errors.JAXTypeError as error:
        cause = str(error).partition("\n")[0]
        raise InputError(f"loss: must be written with jax.numpy; JAX says: {cause}") from error
    shape, kind = getattr(value, "shape", None), getattr(value, "dtype", None)
    if shape != () or kind is None or not jnp.issubdtype(kind, jnp.floating):
        got = type(value).__name__ if shape is None else f"{kind} of shape {list(shape)}"
        raise InputError(f"loss: must return one real number, got {got}")
