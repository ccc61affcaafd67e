"""Milliseconds of each pass of a frame, by GPU timers where they tell the truth, else by the wall clock."""

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

import moderngl

Clock = Literal["gpu", "wall"]

_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software rasterizer")


def truthful_clock(renderer_name: str) -> Clock:
    """ "gpu" where timer queries cover the work, "wall" where they only cover its being handed over.

    Software renderers run a draw's fragments after the query has ended: llvmpipe reports 20 ms for a pass
    that takes 142.
    """
    name = renderer_name.lower()
    return "wall" if any(software in name for software in _SOFTWARE_RENDERERS) else "gpu"


def frame_milliseconds(
    context: moderngl.Context, draw: Callable[[], object], frames: int, clock: Clock | None = None
) -> float:
    """Milliseconds of a whole frame, from an idle GPU until it is finished: the median of `frames`.

    Passes overlap as they do outside of measurements. `clock` None takes the truthful one.
    """
    chosen = truthful_clock(str(context.info["GL_RENDERER"])) if clock is None else clock
    taken = []
    for _ in range(frames):
        context.finish()
        start = time.perf_counter()
        if chosen == "gpu":
            with context.query(time=True) as query:
                draw()
            taken.append(query.elapsed * 1e-6)
        else:
            draw()
            context.finish()
            taken.append(1e3 * (time.perf_counter() - start))
    return statistics.median(taken)


class PassClock:
    """Times the passes of frames that are drawn with it.

    With the wall clock the GPU is finished before and after every pass, which then do not overlap: their sum
    is an upper bound of a frame's time.

    Example:
        >>> clock = PassClock(context)
        >>> for view in views:
        ...     frame.draw(inputs, clock)
        ...     clock.end_frame()
        >>> clock.milliseconds()
        {'geometry': 0.3, 'reflective_shadow_map': 0.4, ...}
    """

    def __init__(self, context: moderngl.Context, kind: Clock | None = None):
        self.kind: Clock = truthful_clock(str(context.info["GL_RENDERER"])) if kind is None else kind
        self._context = context
        self._queries: dict[str, list[moderngl.Query]] = defaultdict(list)
        self._used: list[tuple[str, moderngl.Query]] = []
        self._current: dict[str, float] = defaultdict(float)
        self._history: list[dict[str, float]] = []

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Add the time of the block to the pass called `name`."""
        if self.kind == "gpu":
            # Queries of earlier frames are used again: nothing is allocated once all passes have run.
            pool = self._queries[name]
            query = pool.pop() if pool else self._context.query(time=True)
            with query:
                yield
            self._used.append((name, query))
            return
        self._context.finish()
        start = time.perf_counter()
        yield
        self._context.finish()
        self._current[name] += 1e3 * (time.perf_counter() - start)

    def end_frame(self) -> None:
        """Close the books on one frame: waits for the GPU."""
        for name, query in self._used:
            self._current[name] += query.elapsed * 1e-6
            self._queries[name].append(query)
        self._used.clear()
        self._history.append(dict(self._current))
        self._current.clear()

    def milliseconds(self) -> dict[str, float]:
        """The median over the frames of each pass, in the order in which a frame first ran them.

        Raises:
            ValueError: no frame was ended yet.
        """
        if not self._history:
            raise ValueError("milliseconds: no frame has ended yet")
        names = dict.fromkeys(name for frame in self._history for name in frame)
        return {name: statistics.median(frame.get(name, 0.0) for frame in self._history) for name in names}
