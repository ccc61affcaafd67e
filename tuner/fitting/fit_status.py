"""How a descent and a fit end. A failure is a status with a sentence, never an exception."""

import enum
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

Outcome = Literal["improved", "kept", "unlit", "doubtful"]
"""How a fit ended, as in metrics.json, configs, batch records and reports.

- `improved`: on the validation views, the result is better than the start in at least one measure and worse
  in none (`tuner.evaluation.guard`).
- `kept`: no candidate was, so the start is kept.
- `unlit`: no indirect light reaches the fitted views, so there is nothing to fit.
- `doubtful`: the views or their references cannot be used to judge a fit, so the start is kept.
"""


class FitStatus(enum.Enum):
    """How a descent ended; the value is the sentence shown to the user."""

    CONVERGED = "the loss has settled"
    STEP_LIMIT = "the steps ran out while the loss was still falling"
    NO_IMPROVEMENT = "no parameters better than the start were found; the start is kept"
    NOTHING_LIT = "no indirect light reaches the fitted views, so there is nothing to fit; the start is kept"
    NOT_FINITE = "the loss at the start is not a finite number; the start is kept"

    @property
    def nothing_fitted(self) -> bool:
        """Whether the descent could not run at all."""
        return self in (FitStatus.NOTHING_LIT, FitStatus.NOT_FINITE)


@dataclass(frozen=True, eq=False)
class Descent:
    """The result of a descent: the best point met, which is never worse than the start."""

    point: Float[np.ndarray, " parameters"]
    """In the unit cube."""
    loss: float
    """At `point`; NaN where there is nothing to fit."""
    start_loss: float
    losses: Float[np.ndarray, " steps"]
    """The loss at the start and after every step."""
    status: FitStatus
