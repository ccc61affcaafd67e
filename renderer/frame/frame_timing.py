"""Milliseconds of each pass of a frame, by GPU timers where they tell the truth, else by the wall clock.

Nothing of this is in a frame's way: while a frame is timed its passes are wrapped, and afterwards they are as
they were.
"""

import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from types import TracebackType
from typing import Any, Literal

import moderngl

from vpltune.renderer.frame.frame import Frame

Clock = Literal["gpu", "wall"]

_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software rasterizer")
_STEPS = ("distribute", "draw", "refine")
"""What a pass is asked to do in a frame."""


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


class FrameTiming:
    """Times the passes of `frame` from entering the block to leaving it.

    With the wall clock the GPU is finished before and after every pass, which then do not overlap: their sum
    is an upper bound of a frame's time.

    Example:
        >>> with FrameTiming(context, frame) as timing:
        ...     for view in views:
        ...         frame.draw(view, records, parameters)
        ...         timing.end_frame()
        >>> timing.milliseconds()
        {'geometry': 0.3, 'reflective_shadow_map': 0.4, ...}
    """

    def __init__(self, context: moderngl.Context, frame: Frame, clock: Clock | None = None):
        self.clock: Clock = truthful_clock(str(context.info["GL_RENDERER"])) if clock is None else clock
        self._context = context
        self._frame = frame
        self._queries: dict[str, list[moderngl.Query]] = defaultdict(list)
        self._used: list[tuple[str, moderngl.Query]] = []
        self._current: dict[str, float] = defaultdict(float)
        self._history: list[dict[str, float]] = []

    def __enter__(self) -> "FrameTiming":
        for attribute, value in vars(self._frame).items():
            # A frame also holds its scene, which passes draw.
            if not type(value).__name__.endswith("Pass"):
                continue
            for step in _STEPS:
                if hasattr(value, step):
                    setattr(value, step, self._timed(attribute.lstrip("_"), getattr(value, step)))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for value in vars(self._frame).values():
            for step in _STEPS:
                # The wrapper hides the class's own method, which comes back into sight.
                if step in getattr(value, "__dict__", {}):
                    delattr(value, step)

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

    def _timed(self, name: str, step: Callable[..., Any]) -> Callable[..., Any]:
        def by_wall_clock(*arguments: object, **keywords: object) -> Any:
            self._context.finish()
            start = time.perf_counter()
            result = step(*arguments, **keywords)
            self._context.finish()
            self._current[name] += 1e3 * (time.perf_counter() - start)
            return result

        def by_query(*arguments: object, **keywords: object) -> Any:
            # Queries of earlier frames are used again: nothing is allocated once all passes have run.
            pool = self._queries[name]
            query = pool.pop() if pool else self._context.query(time=True)
            with query:
                result = step(*arguments, **keywords)
            self._used.append((name, query))
            return result

        return by_query if self.clock == "gpu" else by_wall_clock
