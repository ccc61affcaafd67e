"""The rows of a library's tables: figures and thumbnails of tuned scenes, reasons for the others."""

import base64
import io
from dataclasses import dataclass
from typing import Any

from PIL import Image

from vpltune.tuner.batch.record import Record
from vpltune.tuner.evaluation.view_images import VARIANTS
from vpltune.tuner.metrics.tone_curve import display_image
from vpltune.tuner.report.fit_folder import FitFolder, split_figures
from vpltune.tuner.report.page_text import finite
from vpltune.tuner.report.view_blocks import image_exposure

THUMBNAIL_WIDTH = 120
"""Pixels. A choice; library.html.j2 has the same number."""


@dataclass(frozen=True)
class TunedRow:
    """A tuned scene, with its figures on held-out views, or on fitted views if there are no others."""

    name: str
    address: str
    """URL of the scene's page, relative to the library's page."""
    relmse: dict[str, float | None]
    """relMSE by variant; None if unknown."""
    energy_ratio: float | None
    flip: float | None
    seconds: float | None
    fit: str
    """Outcome of the fit: `improved`, `kept` or `doubtful`; empty if unknown."""
    sentence: str
    """The outcome in words."""
    thumbnails: dict[str, str]
    """data: URLs of `reference`, `default` and `tuned`; empty if the fit kept no images."""

    @property
    def ratio(self) -> float | None:
        """relMSE of tuned ÷ default: below 1 if tuning helped, None if unknown."""
        default, tuned = self.relmse["default"], self.relmse["tuned"]
        return None if default is None or tuned is None or default <= 0.0 else tuned / default


@dataclass(frozen=True)
class UntunedRow:
    """A scene without figures, and the reason."""

    name: str
    status: str
    """The status of its record, `unreadable`, or `waiting`."""
    reason: str
    attempts: Any
    seconds: Any
    address: str = ""
    """URL of its page, relative to the library's page; empty if it has none. Unlit scenes have one."""


def tuned_row(name: str, record: Record, fit: FitFolder, page: str) -> TunedRow:
    """The row of a tuned scene. `page` is the URL of its page, relative to the library's page."""
    split = "held_out" if split_figures(fit.document, "held_out", "tuned") else "fitted"
    figures = {variant: split_figures(fit.document, split, variant) for variant in VARIANTS}
    return TunedRow(
        name=name,
        address=page,
        relmse={variant: finite(figures[variant].get("relmse")) for variant in VARIANTS},
        energy_ratio=finite(figures["tuned"].get("energy_ratio")),
        flip=finite(figures["tuned"].get("flip")),
        seconds=finite(record.seconds),
        fit=str(fit.document.get("status", "")),
        sentence=record.reason,
        thumbnails=_thumbnails(fit, split),
    )


def worst_first(rows: list[TunedRow]) -> list[TunedRow]:
    """Rows by descending relMSE of tuned. Rows without a relMSE come first."""

    def badness(row: TunedRow) -> float:
        tuned = row.relmse["tuned"]
        return float("inf") if tuned is None else tuned

    return sorted(rows, key=lambda row: (-badness(row), row.name))


def _thumbnails(fit: FitFolder, split: str) -> dict[str, str]:
    measured = fit.part("per_view")
    of_split = [
        view
        for view in fit.images
        if view.index < len(measured) and measured[view.index].get("split") == split
    ]
    if not fit.images:
        return {}
    view = (of_split or list(fit.images))[0]
    exposure = image_exposure(view)
    return {
        name: _thumbnail(display_image(view.radiance(name), exposure))
        for name in ("reference", "default", "tuned")
    }


def _thumbnail(image: Any) -> str:
    image = Image.fromarray(image)
    height = max(1, round(THUMBNAIL_WIDTH * image.height / image.width))
    file = io.BytesIO()
    image.resize((THUMBNAIL_WIDTH, height), Image.Resampling.LANCZOS).save(file, "JPEG", quality=85)
    return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode('ascii')}"
