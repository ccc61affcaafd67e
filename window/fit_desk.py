"""Runs one fit at a time for the window, in a process of its own."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.window.document import Edited, edited_by_hand
from vpltune.window.fit_watch import FitWatch
from vpltune.window.requests import Failed, FitEnd, FitRequest, FitStep
from vpltune.window.worker import Worker


class FitDesk:
    """The window's fit.

    Args:
        folder: for what a fit writes; replaced by each fit.
        changed: called when the fit has got on, with its config once it has ended with one.
        notify: called with a line and its level.
    """

    def __init__(
        self,
        folder: Path,
        changed: Callable[[TunedConfig | None], None],
        notify: Callable[..., None],
    ):
        self.folder = folder
        self.watch = FitWatch()
        self._changed, self._notify = changed, notify
        self._worker: Worker | None = None
        self._start: TunedConfig | None = None
        self._found: TunedConfig | None = None

    def start(self, request: FitRequest) -> None:
        """Start a fit.

        Raises:
            InputError: one is running.
        """
        if self._worker is not None:
            raise InputError("tune: a fit is running; stop it first")
        shutil.rmtree(self.folder, ignore_errors=True)
        self.watch.begin()
        self._start, self._found = request.start, None
        self._worker = Worker("fit", _fit_for_window, (request,), self._said, self._ended)
        self._changed(None)

    def stop(self) -> Callable[[Edited], Edited] | None:
        """End the fit; returns what takes over the best parameters so far, None if there are none."""
        if self._worker is None or self._start is None:
            return None
        self.close()
        best, start = self.watch.best, self._start
        if best is None:
            self.watch.stop("stopped", "stopped before anything was found; nothing has changed")
            self._changed(None)
            return None
        self.watch.stop(
            "stopped", "stopped; the best parameters so far are taken over, not judged on validation views"
        )
        config = edited_by_hand(start.with_parameters(ArtistParameters.validated(best)))
        return lambda now: replace(now, config=config)

    def close(self) -> None:
        """End the process, if one runs."""
        if self._worker is not None:
            self._worker.stop()
            self._worker = None

    def result_for(self, config: TunedConfig) -> tuple[TunedConfig, Path] | None:
        """The last fit's config and the folder of its files, if `config` draws the same images; else None."""
        found = self._found
        return (found, self.folder) if found is not None and config.draws_as(found) else None

    def _said(self, message: Any) -> None:
        if isinstance(message, FitStep):
            self.watch.step(message)
            self._changed(None)
        elif isinstance(message, FitEnd):
            self._worker = None
            self.watch.end(message)
            self._found = message.config
            for note in message.notes:
                self._notify(note)
            self._changed(message.config)
        elif isinstance(message, Failed):
            self._worker = None
            self.watch.stop("failed", message.reason)
            self._notify(f"the fit failed: {message.reason}", "error")
            self._changed(None)

    def _ended(self, code: int | None) -> None:
        if self._worker is None:
            return  # it has said its last word
        self._worker = None
        self.watch.stop("failed", f"its process ended with {code}; the machine may be out of memory")
        self._notify(f"the fit failed: {self.watch.sentence}", "error")
        self._changed(None)


def _fit_for_window(connection: Any, request: FitRequest) -> None:
    # Imported by the process alone: it loads JAX and Mitsuba.
    from vpltune.window.fit_process import fit_for_window

    fit_for_window(connection, request)
