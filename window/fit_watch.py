"""What the window knows of its fit, from the first stage to the result."""

import time
from dataclasses import dataclass, field
from typing import Any

from vpltune.window.requests import FitEnd, FitStep

STAGE_SHARES = {
    "load": 0.03,
    "reference": 0.62,
    "capture": 0.05,
    "fit": 0.15,
    "validate": 0.1,
    "evaluate": 0.05,
}
"""Share of each stage in the time of a fit, for the time left: measured on the shipped Cornell box."""


@dataclass(eq=False)
class FitWatch:
    """How far the fit is, and what it found."""

    running: bool = False
    stage: str = ""
    share: float = 0.0
    """Share of the stage, in [0, 1]."""
    losses: list[float] = field(default_factory=list)
    """Least loss so far, at each of the tried parameters."""
    best: dict[str, Any] | None = None
    """The parameters with the least loss."""
    status: str = ""
    sentence: str = ""
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Intervals of the parameters of the tuned config."""
    _begun: float = 0.0

    def begin(self) -> None:
        """A fit has started."""
        self.__init__(running=True, stage="load", intervals=self.intervals)
        self._begun = time.monotonic()

    def step(self, step: FitStep) -> None:
        """Take a report of the fit."""
        if step.parameters is not None and step.loss is not None:
            if not self.losses or step.loss <= self.losses[-1]:
                self.best = step.parameters
            self.losses.append(min([step.loss, *self.losses[-1:]]))
        else:
            self.stage, self.share = step.stage, step.share

    def end(self, end: FitEnd) -> None:
        """Take the result."""
        self.running = False
        self.status, self.sentence, self.intervals = end.status, end.sentence, end.intervals

    def stop(self, status: str, sentence: str) -> None:
        """The fit was stopped, or failed."""
        self.running = False
        self.status, self.sentence = status, sentence

    @property
    def overall_share(self) -> float:
        """Share of the whole fit, in [0, 1]."""
        names = list(STAGE_SHARES)
        if self.stage not in STAGE_SHARES:
            return 0.0
        before = sum(STAGE_SHARES[name] for name in names[: names.index(self.stage)])
        return before + STAGE_SHARES[self.stage] * self.share

    def message(self) -> dict[str, Any]:
        """The member `fit` of a `state` message."""
        share = self.overall_share
        spent = time.monotonic() - self._begun
        # Below a twentieth, the time left would be a guess.
        left = spent * (1.0 - share) / share if self.running and share >= 0.05 else None
        return {
            "running": self.running,
            "stage": self.stage,
            "share": share if self.running else 0.0,
            "seconds_left": left,
            "losses": self.losses,
            "parameters": self.best,
            "status": self.status,
            "sentence": self.sentence,
        }
