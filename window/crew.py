"""The processes that draw and that render references: started, watched, and started again."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vpltune.window.drawing_process import draw_for_window
from vpltune.window.requests import Failed, ReferenceRequest, SceneCard, SceneSource
from vpltune.window.worker import Worker

RESTARTS = 3
"""Times that the drawing process is started again within a minute. A choice."""
_MINUTE = 60.0
"""Seconds."""


class Crew:
    """The processes of one window.

    Args:
        source: the scene that they read.
        folder: for the files of references.
        card: called with the card of a scene that can be drawn, the first time and after it was read anew.
        failed: called with the reason if the scene cannot be used at the start.
        answered: called with each answer of the drawing process; with None if it has gone with its work.
        traced: called with each answer of the reference process; with None if it has gone with its work.
        notify: called with a line and its level.
    """

    def __init__(
        self,
        source: SceneSource,
        folder: Path,
        *,
        card: Callable[[SceneCard], None],
        failed: Callable[[str], None],
        answered: Callable[[Any], None],
        traced: Callable[[Any], None],
        notify: Callable[..., None],
    ):
        self._source, self._folder = source, folder
        self._card, self._failed, self._answered, self._traced = card, failed, answered, traced
        self._notify = notify
        self._is_open = False
        self._restarts: list[float] = []
        self._drawing: Worker | None = self._started()
        self._next: Worker | None = None
        self._reference: Worker | None = None

    def draw(self, request: Any) -> None:
        """Hand a request to the drawing process."""
        if self._drawing is not None:
            self._drawing.send(request)

    def trace(self, request: ReferenceRequest) -> None:
        """Hand a request to the reference process, which drops what it was doing."""
        if self._reference is None:
            self._reference = Worker(
                "reference",
                _trace_for_window,
                (self._source, self._folder),
                self._traced,
                self._reference_ended,
            )
        self._reference.send(request)

    def read_again(self) -> None:
        """Read the scene's file anew; until that is done, the old scene is drawn."""
        if self._next is not None:
            self._next.stop()
        self._next = self._started()

    def close(self) -> None:
        """End all processes."""
        for worker in (self._drawing, self._next, self._reference):
            if worker is not None:
                worker.stop()
        self._drawing = self._next = self._reference = None

    def _started(self) -> Worker:
        held: list[Worker] = []
        worker = Worker(
            "drawing",
            draw_for_window,
            (self._source,),
            lambda answer: self._said(held[0], answer),
            lambda code: self._ended(held[0], code),
        )
        held.append(worker)
        return worker

    def _said(self, worker: Worker, answer: Any) -> None:
        if isinstance(answer, SceneCard):
            self._take_over(worker)
            self._card(answer)
        elif isinstance(answer, Failed) and isinstance(answer.request, SceneSource):
            worker.stop()
            self._cannot_read(worker, answer.reason)
        elif worker is self._drawing:
            self._answered(answer)

    def _take_over(self, worker: Worker) -> None:
        self._is_open = True
        if worker is not self._next:
            return
        if self._drawing is not None:
            self._drawing.stop()
        if self._reference is not None:
            # It holds the old scene.
            self._reference.stop()
            self._reference = None
        self._drawing, self._next = worker, None
        self._answered(None)

    def _cannot_read(self, worker: Worker, reason: str) -> None:
        if worker is self._next:
            self._next = None
            self._notify(f"the scene stays as it was read before: {reason}", "error")
        elif self._is_open:
            self._drawing = None
            self._notify(f"nothing can be drawn: {reason}", "error")
        else:
            self._failed(reason)

    def _ended(self, worker: Worker, code: int | None) -> None:
        cause = f"the process that draws ended with {code}"
        if worker is self._next or not self._is_open:
            self._cannot_read(worker, cause)
            return
        now = time.monotonic()
        self._restarts = [*(each for each in self._restarts if now - each < _MINUTE), now]
        if len(self._restarts) > RESTARTS:
            self._drawing = None
            self._notify(f"{cause} again and again; close the window and open it anew", "error")
            return
        self._notify(f"{cause} and is started again", "error")
        self._drawing = self._started()
        self._answered(None)

    def _reference_ended(self, code: int | None) -> None:
        self._reference = None
        self._notify(f"the process that renders references ended with {code}", "error")
        self._traced(None)


def _trace_for_window(connection: Any, source: SceneSource, folder: Path) -> None:
    # Imported by the process alone: it loads Mitsuba.
    from vpltune.window.reference_process import trace_for_window

    trace_for_window(connection, source, folder)
