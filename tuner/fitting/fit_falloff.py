"""Fits intensity and falloff to views with given weights, as one small least-squares problem.

The image is linear in the intensity k. For given values of the other parameters the best k therefore has a
closed form, and the descent runs over the others alone (variable projection, Golub and Pereyra 1973).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.tuner.fitting.descent import Residuals, descend
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.fitting.fit_views import FitView
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.surrogate.reduced_gather import ReducedGather, reduced_image
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters

Data = tuple[ReducedGather, ...]

_INTENSITY = next(spec for spec in ARTIST_PARAMETERS if spec.name == "intensity")


def fit_to(
    views: tuple[FitView, ...],
    start: ArtistParameters,
    *,
    held: frozenset[str] = frozenset(),
    progress: Callable[[float], None] | None = None,
) -> tuple[ArtistParameters, Descent]:
    """Fit intensity and falloff to views.

    Args:
        views: with weights and visibility; all count the same.
        start: where the fit begins, and the values of parameters that are not fitted here.
        held: names of parameters that keep the start's values. k is fitted even if it is named.
        progress: called with the share of steps done, in [0, 1].

    Returns:
        The parameters, and the descent with its point in the cube of all `FALLOFF_SPECS`, k among them. If no
        view is lit, these are the start and the status `NOTHING_LIT`.
    """
    data = tuple(view.reduced for view in views)
    if not any(jnp.any(view.factor != 0.0) for view in data):
        point = SearchSpace().point(start)
        return start, Descent(point, np.nan, np.nan, np.array([np.nan]), FitStatus.NOTHING_LIT)
    offset = float(sum(view.offset for view in data)) / len(data)
    start_loss = float(_squares(FalloffParameters.of(start), data)) + offset
    moved = SearchSpace(
        tuple(spec for spec in SearchSpace().specs if spec is not _INTENSITY and spec.name not in held)
    )
    found = descend(
        _residuals(moved),
        (data, FalloffParameters.of(start)),
        moved.point(start),
        offset=offset,
        progress=progress,
    )
    tuned = moved.parameters(found.point, start)
    tuned = replace(tuned, intensity=float(_best_intensity(FalloffParameters.of(tuned), data)))
    status = found.status
    if not found.loss < start_loss:
        status = FitStatus.NOT_FINITE if status.nothing_fitted else FitStatus.NO_IMPROVEMENT
        tuned = start
    elif status is FitStatus.NO_IMPROVEMENT:
        # The closed form of k alone was an improvement.
        status = FitStatus.CONVERGED
    losses = np.concatenate([[start_loss], found.losses])
    return tuned, Descent(SearchSpace().point(tuned), min(found.loss, start_loss), start_loss, losses, status)


def _images_and_targets(falloff: FalloffParameters, data: Data) -> tuple[Array, Array]:
    images = jnp.concatenate([reduced_image(view, falloff) for view in data])
    return images, jnp.concatenate([view.target for view in data])


def _projected(images: Array, targets: Array) -> Float[Array, ""]:
    """The k in its range that minimises |k·images − targets|²."""
    product = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)
    # 1e-30: without light, every k is equally good, but 0/0 would give NaN.
    best = product(images, targets) / jnp.maximum(product(images, images), 1e-30)
    return jnp.clip(best, _INTENSITY.low, _INTENSITY.high)


@jax.jit
def _best_intensity(falloff: FalloffParameters, data: Data) -> Float[Array, ""]:
    return _projected(*_images_and_targets(replace(falloff, intensity=jnp.ones(())), data))


@jax.jit
def _squares(falloff: FalloffParameters, data: Data) -> Float[Array, ""]:
    images, targets = _images_and_targets(falloff, data)
    return jnp.sum((images - targets) ** 2) / len(data)


@lru_cache
def all_residuals(space: SearchSpace) -> Residuals:
    """Residuals over all of `space`, k included; their data are the reduced views."""

    def residuals(point: Float[Array, " parameters"], data: Data) -> Float[Array, " rows"]:
        images, targets = _images_and_targets(FalloffParameters(**space.values(point)), data)
        return (images - targets) / np.sqrt(len(data))

    return residuals


@lru_cache
def _residuals(space: SearchSpace) -> Residuals:
    # JAX caches compiled code by the function object; `lru_cache` makes one for each space.
    def residuals(
        point: Float[Array, " parameters"], given: tuple[Data, FalloffParameters]
    ) -> Float[Array, " rows"]:
        data, rest = given
        falloff = replace(rest, intensity=jnp.ones(()), **space.values(point))
        images, targets = _images_and_targets(falloff, data)
        return (_projected(images, targets) * images - targets) / np.sqrt(len(data))

    return residuals
