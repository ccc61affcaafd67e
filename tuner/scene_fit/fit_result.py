"""What a fit returns, and how a notebook shows it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.evaluate import Evaluation
from vpltune.tuner.fitting.fit_status import Descent, Outcome


@dataclass(frozen=True, eq=False)
class FitResult:
    """The result of a fit. A notebook shows it as tables and an image."""

    config: TunedConfig
    """The config in tuned.json: the tuned one, or the start if it was kept."""
    status: Outcome
    """`improved`, `kept`, `unlit` or `doubtful`; the reason is in `sentence`."""
    descent: Descent
    evaluation: Evaluation
    notes: tuple[str, ...]
    """Remarks for the user, one sentence each."""
    document: dict[str, Any]
    """The content of metrics.json, which `vpltune fit --json` prints."""
    fitted: ArtistParameters
    """What the fit found on the fitted views, whether or not the validation views accepted it."""
    start: ArtistParameters
    """What the fit began from."""
    views: tuple[View, ...]
    """The views of all splits, as in views.json."""
    comparison: UInt8[np.ndarray, "height width 3"] = field(repr=False)
    """The image in comparison.png, sRGB, row 0 at the top."""

    @property
    def sentence(self) -> str:
        """Why the result was accepted, or why the start was kept."""
        return self.document["sentence"]

    def __repr__(self) -> str:
        changed = ", ".join(
            f"{name} {before:.4g} → {after:.4g}" for name, (before, after) in self.changes().items()
        )
        return f"FitResult({self.status}: {changed or 'nothing changed'}; {self._errors()})"

    def _repr_html_(self) -> str:
        # Imported when it is needed: Jinja takes a tenth of a second to load.
        from vpltune.tuner.scene_fit.result_html import result_html

        return result_html(self)

    def changes(self) -> dict[str, tuple[float, float]]:
        """The parameters in which the config differs from the start: before and after, by name."""
        before, after = self.start.as_dict(), self.config.parameters.as_dict()
        return {name: (before[name], after[name]) for name in before if before[name] != after[name]}

    def _errors(self) -> str:
        """relMSE before and after, on held-out views where there are any."""
        metrics = self.document["metrics"]
        split = "held_out" if metrics["held_out"] else "fitted"
        before, after = (metrics[split][variant]["relmse"] for variant in ("default", "tuned"))
        if before is None or np.isnan(before):
            return "no indirect light"
        return f"relMSE of {split.replace('_', '-')} views {before:.3g} by default, {after:.3g} as returned"
