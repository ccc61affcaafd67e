"""What a search asks: the loss at a point of the unit cube, by the runtime's frames or by the surrogate."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.frame.capture import CapturedFrame, read_image
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.fitting.fit_density import Rotation, view_rotations
from vpltune.tuner.fitting.search_space import FALLOFF_SPECS, VISIBILITY_SPECS, SearchSpace
from vpltune.tuner.metrics.relative_squared_error import Target, target_of, weighted_squared_error
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.vpl_visibility import (
    VisibilityParameters,
    map_texels,
    seen_share,
    surface_overlap,
)
from vpltune.tuner.surrogate.wide_vectors import wide_jit

Point = np.ndarray

PLACED_SPECS = (parameter_spec("density_exponent"), parameter_spec("density_importance"))
SURROGATE_SPACE = SearchSpace((*FALLOFF_SPECS, *VISIBILITY_SPECS))
"""What the surrogate knows of: where VPLs stand is for the runtime to say."""
SPACE = SearchSpace((*SURROGATE_SPACE.specs, *PLACED_SPECS))
"""All continuous parameters that are fitted."""


class SearchIsOver(Exception):  # noqa: N818 - nothing has gone wrong
    """The cap is reached: raised by an objective, caught by whoever started the search."""


@dataclass
class Trace:
    """Every better point that a search met, and what it had spent by then."""

    seconds: list[float] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    losses: list[float] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)
    evaluations: int = 0
    spent_seconds: float = 0.0
    spent_frames: int = 0

    def add(self, point: Point, loss: float, seconds: float, frames: int) -> None:
        self.evaluations += 1
        self.spent_seconds, self.spent_frames = seconds, frames
        if not self.losses or loss < self.losses[-1]:
            self.seconds.append(seconds)
            self.frames.append(frames)
            self.losses.append(loss)
            self.points.append(np.array(point))


class CountingRuntime(Runtime):
    """A runtime that knows how many frames it has drawn."""

    frames = 0

    def _draw(self, *arguments: object, **keywords: object) -> Frame:
        self.frames += 1
        return super()._draw(*arguments, **keywords)

    def captures(self, view: View, table_rotations: Sequence[Rotation]) -> list[CapturedFrame]:
        # Though the others are drawn in part only.
        self.frames += len(table_rotations) - 1
        return super().captures(view, table_rotations)


class RuntimeLoss:
    """relMSE, free of the reference's noise, of what the runtime draws: every view drawn at every rotation of
    the point table, read back and compared, each time."""

    def __init__(
        self,
        runtime: Runtime,
        views: Sequence[CapturedView],
        rotations: Sequence[Rotation],
        base: ArtistParameters,
    ):
        self._runtime, self._views, self._rotations, self._base = runtime, views, rotations, base
        # As numpy arrays: what they cost to compare is not to be JAX's start of a computation.
        self._targets = [
            tuple(np.asarray(part) for part in (target.half_a, target.half_b, target.weight))
            for target in (_target(view) for view in views)
        ]

    def __call__(self, point: Point) -> float:
        self._runtime.parameters = SPACE.parameters(point, self._base)
        return self.of_images(self._drawn)

    def of_images(self, image_of: Callable[[CapturedView, Rotation], np.ndarray]) -> float:
        """The loss of any images, [height, width, 3] each."""
        losses = []
        for index, (view, (half_a, half_b, weight)) in enumerate(
            zip(self._views, self._targets, strict=True)
        ):
            for rotation in view_rotations(self._rotations, index):
                values = image_of(view, rotation)[view.valid].astype(np.float64)
                losses.append(float((weight * (values - half_a) * (values - half_b)).sum()))
        return float(np.mean(losses))

    def _drawn(self, view: CapturedView, rotation: Rotation) -> np.ndarray:
        return read_image(self._runtime._draw(view.view, rotation).indirect_irradiance)[..., :3]


class SurrogateLoss:
    """The same of the surrogate, at points of `SURROGATE_SPACE`, for VPLs as they stand in captured views."""

    def __init__(self, views: Sequence[CapturedView], rest: ArtistParameters):
        self._rest = FalloffParameters.of(rest)
        pairs = []
        for view in views:
            receivers, vpls = gather_inputs(view.captured, view.usable_pixels())
            assert view.captured.visibility_maps is not None, "captured without visibility maps"
            overlap = surface_overlap(receivers, vpls, map_texels(view.captured.visibility_maps))
            pairs.append((receivers, vpls, overlap, _target(view)))
        self._pairs = tuple(pairs)

    def __call__(self, point: Point) -> float:
        return float(_surrogate_loss(jnp.asarray(point, jnp.float32), self._pairs, self._rest))


@wide_jit
def _surrogate_loss(point: jax.Array, pairs: tuple, rest: FalloffParameters) -> jax.Array:
    values = SURROGATE_SPACE.values(point)
    visibility = VisibilityParameters(*(values.pop(spec.name) for spec in VISIBILITY_SPECS))
    falloff = replace(rest, **values)
    losses = [
        weighted_squared_error(gather(receivers, vpls, falloff, seen_share(overlap, visibility)), target)
        for receivers, vpls, overlap, target in pairs
    ]
    return jnp.mean(jnp.stack(losses))


def _target(view: CapturedView) -> Target:
    halves = (half[view.valid] for half in (view.reference.irradiance_a, view.reference.irradiance_b))
    return target_of(*halves)


class CappedObjective:
    """Counts into a trace, keeps the time, and ends a search after so many more evaluations, or seconds since
    `started`."""

    def __init__(
        self,
        loss: Callable[[Point], float],
        trace: Trace,
        frames: Callable[[], int],
        evaluations: int | None = None,
        *,
        seconds: float,
        started: float | None = None,
    ):
        self._loss, self._trace, self._frames = loss, trace, frames
        self._last = None if evaluations is None else trace.evaluations + evaluations
        self._started = time.perf_counter() if started is None else started
        self._seconds = seconds

    def __call__(self, point: Point) -> float:
        point = np.clip(np.asarray(point, np.float64), 0.0, 1.0)
        loss = float(self._loss(point))
        elapsed = time.perf_counter() - self._started
        self._trace.add(point, loss, elapsed, self._frames())
        if self._trace.evaluations == self._last or elapsed >= self._seconds:
            raise SearchIsOver
        return loss
