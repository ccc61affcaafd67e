"""What a descent ends with. One that fails is a status with a sentence, never an exception."""

import enum
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

Outcome = Literal["ok", "unlit", "failed"]
"""`unlit`: no indirect light reaches the views, which is no failure: there is nothing to fit."""


class FitStatus(enum.Enum):
    """How it ended; the value is the sentence shown to the user."""

    CONVERGED = "the loss has settled"
    STEP_LIMIT = "the steps ran out while the loss was still falling"
    NO_IMPROVEMENT = "no parameters better than the start were found; the start is kept"
    NOTHING_LIT = "no indirect light reaches the fitted views, so there is nothing to fit; the start is kept"
    NOT_FINITE = "the loss at the start is not a finite number; the start is kept"

    @property
    def outcome(self) -> Outcome:
        """In a word, as metrics.json and records have it."""
        words: dict[FitStatus, Outcome] = {FitStatus.NOTHING_LIT: "unlit", FitStatus.NOT_FINITE: "failed"}
        return words.get(self, "ok")

    @property
    def nothing_fitted(self) -> bool:
        """Whether there was nothing that could be fitted."""
        return self.outcome != "ok"


@dataclass(frozen=True, eq=False)
class Descent:
    """The best point met, which is never worse than the start."""

    point: Float[np.ndarray, " parameters"]
    """In the unit cube."""
    loss: float
    start_loss: float
    losses: Float[np.ndarray, " steps"]
    """The loss at every step, the start first."""
    status: FitStatus
