"""The rows of a library's table: a scene's figures and thumbnails, and what became of those without."""

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


@dataclass(frozen=True)
class TunedRow:
    """A scene that was tuned; relMSE, energy ratio and FLIP on held-out views, where there are any."""

    name: str
    address: str
    """Of its page, relative to the library's."""
    relmse: dict[str, float | None]
    """By variant."""
    energy_ratio: float | None
    flip: float | None
    seconds: float | None
    fit: str
    """How the fit ended: `improved`, `kept` or `doubtful`; empty where that is not known."""
    sentence: str
    thumbnails: dict[str, str]
    """data: addresses of `reference`, `default` and `tuned`; empty where the fit kept no images."""

    @property
    def ratio(self) -> float | None:
        """relMSE tuned over default: below 1 where tuning helped."""
        default, tuned = self.relmse["default"], self.relmse["tuned"]
        return None if default is None or tuned is None or default <= 0.0 else tuned / default


@dataclass(frozen=True)
class UntunedRow:
    """A scene that has no figures, and why."""

    name: str
    status: str
    reason: str
    attempts: Any
    seconds: Any
    address: str = ""
    """Of its page, where there was nothing to fit but a page all the same."""


def tuned_row(name: str, record: Record, fit: FitFolder, page: str) -> TunedRow:
    """The row of a scene whose fit was read; `page` is the address of its page."""
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
    """By relMSE after tuning, the greatest first; what has none is worse than any."""

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
