"""The page of a library: totals, tuned scenes from worst to best, and other scenes with the reason."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

from vpltune.tuner.evaluation.view_images import VARIANTS
from vpltune.tuner.report.batch_folder import BatchFolder
from vpltune.tuner.report.library_rows import TunedRow, UntunedRow, worst_first
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES, page_html
from vpltune.tuner.report.page_text import change, finite, number, seconds
from vpltune.tuner.report.scaled_axis import Axis, Tick, axis_around

MAXIMUM_DRAWN = 40
"""Scenes in the chart, the worst ones. A choice: a longer chart is hard to read."""
# Row height and margins of the chart in the units of its SVG. A choice; library.html.j2 draws the same frame.
_ROW_HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 22.0, 230.0, 700.0, 26.0, 36.0
_ROW_BYTES = 1500
"""Upper estimate of the bytes of a table row without its thumbnails and texts. A choice."""
_REST_OF_PAGE = 200_000
"""Bytes reserved for everything but the tables: chart, style and script. A choice."""


@dataclass(frozen=True)
class DumbbellRow:
    """One scene of the chart: the relMSE of default, tuned and ceiling, in the units of the SVG."""

    name: str
    y: float
    spots: list[tuple[str, float]]
    """Variant and x of each dot."""
    span: tuple[float, float]
    """x of default and tuned, which a line connects."""


@dataclass(frozen=True)
class DumbbellChart:
    """relMSE before and after tuning, one row for each scene."""

    description: str
    """What the chart shows, in words, for readers who cannot see it."""
    height: float
    rows: list[DumbbellRow]
    ticks: list[Tick]


def library_page(batch: BatchFolder, tuned: list[TunedRow], untuned: list[UntunedRow]) -> str:
    """The HTML of a library's page."""
    ordered = worst_first(tuned)
    shown, left_out = _within_size(ordered, untuned)
    records = batch.records.values()
    finished = sorted(record.finished for record in records if isinstance(record.finished, str))
    return page_html(
        "library.html.j2",
        ("page.css", "library.css"),
        "library.js",
        cards=_cards(batch, ordered, untuned),
        chart=dumbbell_chart(ordered),
        rows=shown,
        untuned=sorted(untuned, key=lambda row: (row.status, row.name))[: _untuned_limit(untuned)],
        untuned_left_out=max(0, len(untuned) - _untuned_limit(untuned)),
        left_out=left_out,
        origin=[
            ("library", batch.library),
            ("scenes", str(len(records) + len(batch.waiting))),
            ("hosts", ", ".join(sorted({str(record.host) for record in records}))),
            ("finished", " to ".join(sorted({finished[0], finished[-1]}))) if finished else ("finished", ""),
        ],
    )


def dumbbell_chart(rows: list[TunedRow]) -> DumbbellChart | None:
    """Chart of relMSE before and after tuning, on a log axis; None if no row has both values."""
    drawable = [
        row for row in rows if (row.relmse["tuned"] or 0.0) > 0.0 and (row.relmse["default"] or 0.0) > 0.0
    ]
    drawable = drawable[:MAXIMUM_DRAWN]
    if not drawable:
        return None
    values = [value for row in drawable for value in row.relmse.values() if value is not None and value > 0.0]
    axis = axis_around(values, _LEFT, _RIGHT, "log")
    height = _TOP + _ROW_HEIGHT * len(drawable) + _BOTTOM
    better = sum(row.ratio is not None and row.ratio < 1.0 for row in drawable)
    return DumbbellChart(
        f"relMSE of {len(drawable)} scenes before and after tuning; it fell in {better} of them.",
        height,
        [_dumbbell(row, axis, _TOP + _ROW_HEIGHT * (index + 0.5)) for index, row in enumerate(drawable)],
        [(axis.place(tick), number(tick)) for tick in axis.ticks()],
    )


def _dumbbell(row: TunedRow, axis: Axis, y: float) -> DumbbellRow:
    spots = [
        (variant, axis.place(value))
        for variant in ("ceiling", "default", "tuned")
        if (value := row.relmse[variant]) is not None and value > 0.0
    ]
    places = dict(spots)
    name = row.name if len(row.name) <= 30 else f"…{row.name[-29:]}"
    return DumbbellRow(name, round(y, 2), spots, (places["default"], places["tuned"]))


def _cards(batch: BatchFolder, rows: list[TunedRow], untuned: list[UntunedRow]) -> list[dict[str, str]]:
    total = len(rows) + len(untuned)
    counts = {
        status: sum(row.status == status for row in untuned)
        for status in ("unlit", "refused", "failed", "unreadable", "waiting")
    }
    middle = {variant: _median([row.relmse[variant] for row in rows]) for variant in VARIANTS}
    fell = change(middle["default"], middle["tuned"])
    ratios = [row.ratio for row in rows if row.ratio is not None]
    spent = [finite(record.seconds) or 0.0 for record in {r.key: r for r in batch.records.values()}.values()]
    return [
        {
            "what": "Scenes tuned",
            "before": "",
            "after": f"{len(rows)} of {total}",
            "note": ", ".join(f"{count} {status}" for status, count in counts.items() if count),
        },
        {
            "what": "Median relMSE",
            "before": number(middle["default"]),
            "after": number(middle["tuned"]),
            "note": " · ".join(filter(None, (fell, f"ceiling {number(middle['ceiling'])}"))),
        },
        {
            "what": "Better than default",
            "before": "",
            "after": f"{sum(ratio < 1.0 for ratio in ratios)} of {len(ratios)}",
            "note": f"median energy ratio {number(_median([row.energy_ratio for row in rows]))}",
        },
        {
            "what": "Total time",
            "before": "",
            "after": seconds(sum(spent)),
            "note": f"median {seconds(_median(spent))} per scene" if spent else "",
        },
    ]


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(median(known)) if known else None


def _untuned_limit(untuned: list[UntunedRow]) -> int:
    """Number of untuned scenes that fit into the fifth of the page that is reserved for them."""
    room, count = MAXIMUM_PAGE_BYTES // 5, 0
    for row in untuned:
        room -= _ROW_BYTES // 2 + 6 * len(row.name) + 6 * len(row.reason)
        if room < 0:
            break
        count += 1
    return count


def _within_size(rows: list[TunedRow], untuned: list[UntunedRow]) -> tuple[list[TunedRow], int]:
    """The worst rows that fit into the page, and the number of rows left out.

    Rows lose their thumbnails before any row is left out.
    """
    room = MAXIMUM_PAGE_BYTES - _REST_OF_PAGE - (MAXIMUM_PAGE_BYTES // 5 if untuned else 0)
    # Thumbnails may take half of the room. The other half holds thousands of rows without thumbnails.
    images, shown = room // 2, []
    for row in rows:
        weight = sum(len(address) for address in row.thumbnails.values())
        # An escaped character takes up to six bytes, and a row contains its name three times.
        words = _ROW_BYTES + 18 * len(row.name) + 6 * len(row.sentence)
        if weight > images:
            row, weight = replace(row, thumbnails={}), 0
        if words + weight > room:
            break
        images -= weight
        room -= words + weight
        shown.append(row)
    return shown, len(rows) - len(shown)
