"""Milliseconds of passes and of whole frames, by size, VPL count, placement and interleaving."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import moderngl

from benchmarks.harness.machine_rates import MachineRates
from benchmarks.harness.row import Row
from benchmarks.speed.frame_limits import pass_limits
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import VISIBILITIES, TunedConfig
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.frame_timing import PassClock, frame_milliseconds
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

SIZES = {"720p": (1280, 720), "1080p": (1920, 1080), "1440p": (2560, 1440), "4K": (3840, 2160)}
"""Width and height of the frames in pixels."""
PASS_SIZE = "1080p"
PASS_CONFIG = TunedConfig(light=ONE_BOUNCE)
"""The config of the pass rows: the default."""
COUNTS = (64, 256, 1024, 4096)
"""VPLs of the frames. A choice."""
PLACEMENTS = {"points": 0, "discs": ArtistParameters().lloyd_iterations}
"""Lloyd iterations by the name of the placement: as many as the default has."""
INTERLEAVES = {"full": 1, "interleaved": 4}
"""Pixels along the side of an interleaved block. A choice."""


@dataclass(frozen=True)
class Timing:
    """How long a row may take, and how often it is timed."""

    row_seconds: float = 20.0
    """Seconds beyond which a row is left out or timed less often. A choice: all rows are then done in minutes
    on a GPU, and within half an hour on a software renderer."""
    frames: int = 5
    """Timed frames, of which the median counts. A choice."""

    def frames_for(self, milliseconds: float) -> int:
        """As many frames as the row's time has room for, of so many milliseconds each; at least one."""
        return max(1, min(self.frames, int(1e3 * self.row_seconds / max(milliseconds, 1e-3))))


@dataclass(frozen=True, eq=False)
class MeasuredScene:
    """A scene and a view of it, on the machine that is measured."""

    scene: Scene
    view: View
    context: moderngl.Context
    rates: MachineRates
    timing: Timing

    @property
    def against_limit(self) -> str:
        """What rows are compared with that have a limit, and the clock that timed them."""
        return f"its limit ({self.rates.clock} clock)"

    def runtime(self, options: RuntimeOptions | None = None) -> Runtime:
        """A runtime of its own: what it keeps on the GPU goes when it goes."""
        return Runtime(self.scene, options or RuntimeOptions(), context=self.context)

    def sized(self, size: tuple[int, int]) -> View:
        """The view at another size."""
        return replace(self.view, size=size)

    def limits(self, drawn: DrawnFrame, config: TunedConfig) -> dict[str, float]:
        """The least milliseconds of each pass."""
        return pass_limits(drawn, config, self.scene.triangle_count(), self.rates)

    def pass_milliseconds(self, drawn: DrawnFrame) -> dict[str, float]:
        """Milliseconds of each pass of a frame that was drawn before, timed as often as there is room for."""
        once = self._timed_passes(drawn, 1)
        frames = self.timing.frames_for(sum(once.values()))
        return once if frames == 1 else self._timed_passes(drawn, frames)

    def _timed_passes(self, drawn: DrawnFrame, frames: int) -> dict[str, float]:
        clock = PassClock(self.context, self.rates.clock)
        for _ in range(frames):
            drawn.frame.draw(drawn.inputs, clock)
            drawn.frame.resolve((1.0, 1.0), None, clock)
            clock.end_frame()
        return clock.milliseconds()

    def frame_milliseconds(self, draw: Callable[[], object]) -> float:
        """Milliseconds of a whole frame, which `draw` has drawn before."""
        once = frame_milliseconds(self.context, draw, 1, self.rates.clock)
        frames = self.timing.frames_for(once)
        return once if frames == 1 else frame_milliseconds(self.context, draw, frames, self.rates.clock)


def pass_rows(measured: MeasuredScene) -> Iterator[Row]:
    """A row for each pass of the default frame, for each visibility."""
    size = SIZES[PASS_SIZE]
    for visibility in VISIBILITIES:
        config = PASS_CONFIG.seen_by(visibility)
        drawn = measured.runtime().draw(measured.sized(size), config)
        limits = measured.limits(drawn, config)
        for name, value in measured.pass_milliseconds(drawn).items():
            yield Row(
                f"pass.{PASS_SIZE}.{visibility}.{name}", value, "ms", measured.against_limit, limits[name]
            )


def frame_rows(measured: MeasuredScene) -> Iterator[Row]:
    """A row for each whole frame with visibility maps, in series of growing VPL counts."""
    for size_name, size in SIZES.items():
        view = measured.sized(size)
        for placement, iterations in PLACEMENTS.items():
            for gather, interleave in INTERLEAVES.items():
                series = Series(measured.timing)
                for count in COUNTS:
                    name = f"frame.{size_name}.{count}_{placement}.{gather}"
                    if series.too_long(count):
                        yield series.left_out(name, count)
                        continue
                    config = TunedConfig(
                        ArtistParameters(vpl_count=count, lloyd_iterations=iterations),
                        quality=Quality(interleave=interleave),
                        light=ONE_BOUNCE,
                    )
                    runtime = measured.runtime()
                    drawn = runtime.draw(view, config)
                    taken = measured.frame_milliseconds(partial(runtime.draw, view, config))
                    series.note(count, taken)
                    limit = sum(measured.limits(drawn, config).values())
                    yield Row(name, taken, "ms", measured.against_limit, limit)


def frame_count() -> int:
    """How many rows `frame_rows` yields."""
    return len(SIZES) * len(PLACEMENTS) * len(INTERLEAVES) * len(COUNTS)


class Series:
    """Rows of growing work, of which those are left out that would take too long."""

    def __init__(self, timing: Timing):
        self._timing = timing
        self._measured: list[tuple[float, float]] = []

    def note(self, work: float, milliseconds: float) -> None:
        """Remember what so much work took."""
        self._measured.append((work, milliseconds))

    def expected(self, work: float) -> float:
        """Milliseconds of so much work, on the line through the last two rows; 0 before there are two."""
        if len(self._measured) < 2:
            return 0.0
        (less, before), (more, after) = self._measured[-2:]
        return after + (work - more) * max(0.0, after - before) / (more - less)

    def too_long(self, work: float) -> bool:
        """Whether three frames, the least that a row draws, would take longer than a row may."""
        return 3e-3 * self.expected(work) > self._timing.row_seconds

    def left_out(self, name: str, work: float) -> Row:
        """The row that stands for one that is not measured: its value is not a number."""
        expected = self.expected(work) / 1e3
        against = f"left out: a frame would take {expected:.2g} s; the limit of a row"
        return Row(name, float("nan"), "ms", against, 1e3 * self._timing.row_seconds)
