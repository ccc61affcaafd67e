"""The page of a library: totals, every scene worst first, and what was not tuned with its reason."""

from dataclasses import dataclass, replace
from statistics import median

from vpltune.tuner.evaluation.view_images import VARIANTS
from vpltune.tuner.report.batch_folder import BatchFolder
from vpltune.tuner.report.library_rows import TunedRow, UntunedRow, worst_first
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES, page_html
from vpltune.tuner.report.page_text import change, finite, number, seconds
from vpltune.tuner.report.scaled_axis import Axis, Tick, axis_around

MAXIMUM_DRAWN = 40
"""Scenes in the drawing, the worst: more would not be told apart."""
_ROW_HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 22.0, 230.0, 700.0, 26.0, 36.0
_ROW_BYTES = 1500
"""What a row weighs but for its thumbnails and its words, generously."""
_REST_OF_PAGE = 200_000


@dataclass(frozen=True)
class DumbbellRow:
    """One scene of the drawing: where default, tuned and ceiling stand."""

    name: str
    y: float
    spots: list[tuple[str, float]]
    """Variant and place."""
    span: tuple[float, float]


@dataclass(frozen=True)
class DumbbellChart:
    description: str
    height: float
    rows: list[DumbbellRow]
    ticks: list[Tick]


def library_page(batch: BatchFolder, tuned: list[TunedRow], untuned: list[UntunedRow]) -> str:
    """The HTML text of a library's page."""
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
    """relMSE before and after on a log axis, worst scene at the top; None where nothing can be drawn."""
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
            "what": "relMSE, median",
            "before": number(middle["default"]),
            "after": number(middle["tuned"]),
            "note": " · ".join(filter(None, (fell, f"ceiling {number(middle['ceiling'])}"))),
        },
        {
            "what": "Better than default",
            "before": "",
            "after": f"{sum(ratio < 1.0 for ratio in ratios)} of {len(ratios)}",
            "note": f"energy ratio {number(_median([row.energy_ratio for row in rows]))} in the median",
        },
        {
            "what": "Time on scenes",
            "before": "",
            "after": seconds(sum(spent)),
            "note": f"{seconds(_median(spent))} a scene in the median" if spent else "",
        },
    ]


def _median(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(median(known)) if known else None


def _untuned_limit(untuned: list[UntunedRow]) -> int:
    """How many of the scenes that were not tuned the page lists: a fifth of its size for them."""
    room, count = MAXIMUM_PAGE_BYTES // 5, 0
    for row in untuned:
        room -= _ROW_BYTES // 2 + 6 * len(row.name) + 6 * len(row.reason)
        if room < 0:
            break
        count += 1
    return count


def _within_size(rows: list[TunedRow], untuned: list[UntunedRow]) -> tuple[list[TunedRow], int]:
    """The worst rows, as many as the page may hold, and how many are left out; thumbnails go first."""
    room = MAXIMUM_PAGE_BYTES - _REST_OF_PAGE - (MAXIMUM_PAGE_BYTES // 5 if untuned else 0)
    # Half of the page for thumbnails: the other half holds thousands of rows without.
    images, shown = room // 2, []
    for row in rows:
        weight = sum(len(address) for address in row.thumbnails.values())
        # Escaped, a character may take six bytes; a name stands in a row three times.
        words = _ROW_BYTES + 18 * len(row.name) + 6 * len(row.sentence)
        if weight > images:
            row, weight = replace(row, thumbnails={}), 0
        if words + weight > room:
            break
        images -= weight
        room -= words + weight
        shown.append(row)
    return shown, len(rows) - len(shown)
