"""What a search asks: the loss at a point of the unit cube, by the runtime's frames or by the surrogate."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import jax
import numpy as np

from renderer.artist_parameters import ArtistParameters
from renderer.capture import read_picture
from renderer.runtime import Runtime
from tuner.captured_view import CapturedView
from tuner.losses.relative_squared_error import EVEN_SHARE, target_of
from tuner.search_space import SearchSpace

Point = np.ndarray


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

    def add(self, point: Point, loss: float, seconds: float, frames: int) -> None:
        self.evaluations += 1
        self.spent_seconds = seconds
        if not self.losses or loss < self.losses[-1]:
            self.seconds.append(seconds)
            self.frames.append(frames)
            self.losses.append(loss)
            self.points.append(np.array(point))


class RuntimeLoss:
    """The fit's own loss of what the runtime draws: every view drawn, read back and compared, each time."""

    def __init__(self, runtime: Runtime, views: tuple[CapturedView, ...], base: ArtistParameters):
        self._runtime, self._views, self._base = runtime, views, base
        self._space = SearchSpace()
        self._targets = [
            target_of(
                view.reference.irradiance_a[view.valid], view.reference.irradiance_b[view.valid], EVEN_SHARE
            )
            for view in views
        ]
        # As numpy arrays: what they cost to compare is not to be JAX's start of a computation.
        self._targets = [tuple(map(np.asarray, (t.half_a, t.half_b, t.weight))) for t in self._targets]
        self.frames = 0

    def __call__(self, point: Point) -> float:
        self._runtime.parameters = self._space.parameters(point, self._base)
        return self.of_pictures(self._drawn)

    def of_pictures(self, picture_of: Callable[[CapturedView], np.ndarray]) -> float:
        """The loss of any pictures, [height, width, 3] each."""
        losses = []
        for view, (half_a, half_b, weight) in zip(self._views, self._targets, strict=True):
            values = picture_of(view)[view.valid].astype(np.float64)
            losses.append(float((weight * (values - half_a) * (values - half_b)).sum()))
        return float(np.mean(losses))

    def _drawn(self, view: CapturedView) -> np.ndarray:
        self.frames += 1
        return read_picture(self._runtime._draw(view.view).indirect_irradiance)[..., :3]


class CappedObjective:
    """Counts, keeps the time, and ends a search at its cap."""

    def __init__(
        self,
        loss: Callable[[Point], float],
        frames: Callable[[], int],
        started: float,
        evaluations: int,
        seconds: float,
    ):
        self.trace = Trace()
        self._loss, self._frames, self._started = loss, frames, started
        self._evaluations, self._seconds = evaluations, seconds

    def __call__(self, point: Point) -> float:
        point = np.clip(np.asarray(point, np.float64), 0.0, 1.0)
        loss = float(self._loss(point))
        elapsed = time.perf_counter() - self._started
        self.trace.add(point, loss, elapsed, self._frames())
        if self.trace.evaluations >= self._evaluations or elapsed >= self._seconds:
            raise SearchIsOver
        return loss


def surrogate_loss(squares: Callable[[jax.Array], jax.Array], offset: float) -> Callable[[Point], float]:
    """The fit's loss at a point, from a compiled function of it."""

    def loss(point: Point) -> float:
        return float(squares(np.asarray(point, np.float32))) + offset

    return loss
