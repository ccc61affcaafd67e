"""Objectives that searches minimise: the loss at a point of the unit cube, from the runtime or the surrogate.

A search evaluates a `CappedObjective`, which records its progress in a `Trace` and ends it at a limit.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame, read_image
from vpltune.renderer.frame.drawn_frame import DrawnFrame
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
"""A point of the unit cube, with a coordinate for each parameter of a `SearchSpace`."""

PLACED_SPECS = (parameter_spec("density_exponent"), parameter_spec("density_importance"))
"""Parameters that move the VPLs."""
SURROGATE_SPACE = SearchSpace((*FALLOFF_SPECS, *VISIBILITY_SPECS))
"""The parameters that the surrogate knows: it takes the VPLs where the runtime has placed them."""
SPACE = SearchSpace((*SURROGATE_SPACE.specs, *PLACED_SPECS))
"""All continuous parameters that a fit of few VPLs adjusts."""


class SearchIsOver(Exception):  # noqa: N818 - nothing has gone wrong
    """An objective's limit is reached: it raises this, and the code that started the search catches it."""


@dataclass
class Trace:
    """The points at which a search improved its loss, with the time and frames it had spent by then."""

    seconds: list[float] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    losses: list[float] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)
    evaluations: int = 0
    """Evaluations so far, of all points."""
    spent_seconds: float = 0.0
    """Seconds so far, also since the last improvement."""
    spent_frames: int = 0

    def add(self, point: Point, loss: float, seconds: float, frames: int) -> None:
        """Count an evaluation, and keep its point if its loss is the least so far."""
        self.evaluations += 1
        self.spent_seconds, self.spent_frames = seconds, frames
        if not self.losses or loss < self.losses[-1]:
            self.seconds.append(seconds)
            self.frames.append(frames)
            self.losses.append(loss)
            self.points.append(np.array(point))


class CountingRuntime(Runtime):
    """A runtime that counts the frames it draws."""

    frames = 0

    def _draw(self, *arguments: Any, **keywords: Any) -> DrawnFrame:
        self.frames += 1
        return super()._draw(*arguments, **keywords)

    def captures(
        self, view: View, config: TunedConfig, table_rotations: Sequence[Rotation]
    ) -> list[CapturedFrame]:
        """As `Runtime.captures`; every rotation counts as a frame, although most are drawn in part."""
        self.frames += len(table_rotations) - 1
        return super().captures(view, config, table_rotations)

    def indirect_irradiance(self, view: View, config: TunedConfig, rotation: Rotation) -> np.ndarray:
        """Indirect irradiance [W/m²] of a view, [height, width, 3]; nothing else is read back or resolved."""
        self.context.__enter__()
        drawn = self._draw(view, config, None, table_rotation=rotation)
        return read_image(drawn.frame.resources, "indirect_irradiance")[..., :3]


class RuntimeLoss:
    """relMSE of the runtime's images without the reference's noise, the mean over views and rotations.

    Every evaluation draws each view at each rotation of the point table, reads the image back, and compares
    it with the reference.
    """

    def __init__(
        self,
        runtime: CountingRuntime,
        views: Sequence[CapturedView],
        rotations: Sequence[Rotation],
        config: TunedConfig,
    ):
        """`config` holds the parameters that are not searched."""
        self._runtime, self._views, self._rotations, self._config = runtime, views, rotations, config
        # As numpy arrays, so that a comparison does not pay for starting a JAX computation.
        self._targets = [
            tuple(np.asarray(part) for part in (target.half_a, target.half_b, target.weight))
            for target in (_target(view) for view in views)
        ]

    def __call__(self, point: Point) -> float:
        config = self._config.with_parameters(SPACE.parameters(point, self._config.parameters))
        return self.of_images(
            lambda view, rotation: self._runtime.indirect_irradiance(view.view, config, rotation)
        )

    def of_images(self, image_of: Callable[[CapturedView, Rotation], np.ndarray]) -> float:
        """The loss of other images of the views, [height, width, 3] each."""
        losses = []
        for index, (view, (half_a, half_b, weight)) in enumerate(
            zip(self._views, self._targets, strict=True)
        ):
            for rotation in view_rotations(self._rotations, index):
                values = image_of(view, rotation)[view.valid].astype(np.float64)
                losses.append(float((weight * (values - half_a) * (values - half_b)).sum()))
        return float(np.mean(losses))


class SurrogateLoss:
    """The loss of the surrogate's images at points of `SURROGATE_SPACE`, with the VPLs of captured views."""

    def __init__(self, views: Sequence[CapturedView], rest: ArtistParameters):
        """`rest` holds the falloff parameters that are not searched."""
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
    """An objective that records its evaluations in a trace, and raises `SearchIsOver` at a limit.

    Args:
        loss: the loss at a point.
        trace: what evaluations are recorded in; several objectives may share it.
        frames: gives the number of frames drawn so far.
        evaluations: the limit of further evaluations; None sets none.
        seconds: the limit of seconds since `started`.
        started: a value of `time.perf_counter`; None takes the present.
    """

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
