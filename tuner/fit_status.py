"""What a descent ends with. One that fails is a status with a sentence, never an exception."""

import enum
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


class FitStatus(enum.Enum):
    """How it ended; the value is the sentence shown to the user."""

    CONVERGED = "the loss has settled"
    STEP_LIMIT = "the steps ran out while the loss was still falling"
    NO_IMPROVEMENT = "no parameters better than the start were found; the start is kept"
    NOTHING_LIT = "no indirect light reaches the fitted views, so there is nothing to fit; the start is kept"
    NOT_FINITE = "the loss at the start is not a finite number; the start is kept"

    @property
    def failed(self) -> bool:
        """Whether there was nothing that could be fitted."""
        return self in (FitStatus.NOTHING_LIT, FitStatus.NOT_FINITE)

    @property
    def start_kept(self) -> bool:
        """Whether the result is the start itself."""
        return self.failed or self is FitStatus.NO_IMPROVEMENT


@dataclass(frozen=True, eq=False)
class Descent:
    """The best point met, which is never worse than the start."""

    point: Float[np.ndarray, "parameters"]
    """In the unit cube."""
    loss: float
    start_loss: float
    losses: Float[np.ndarray, "steps"]
    """The loss at every step, the start first."""
    status: FitStatus
