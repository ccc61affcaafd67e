"""The tables that `fit` and `evaluate` print."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS

if TYPE_CHECKING:
    from rich.console import JustifyMethod

ROWS = ("default", "tuned", "ceiling")
SPLITS = {"fitted": "fitted views", "held_out": "held-out views"}
FIGURES = {
    "relmse": "relMSE",
    "trimmed_relmse": "without\nworst",
    "worst_share": "share of\nworst",
    "median_error": "median\npixel",
    "energy_ratio": "energy",
    "flip": "FLIP",
}
"""Heading of each metric (`tuner.metrics.view_metrics.ViewMetrics`). The table fits into 80 columns."""
_SHARES = ("worst_share", "median_error")


def metrics_table(metrics: Mapping[str, Any]) -> Any:
    """A rich table of the metrics of default, tuned and ceiling, and of the noise floor, by split.

    `metrics` is the key `metrics` of metrics.json.
    """
    from rich.table import Table

    table = Table(title="Against the path tracer (worst: 0.1 % of the pixels)", title_justify="left")
    table.add_column("", no_wrap=True)
    for heading in FIGURES.values():
        table.add_column(heading, justify="right", no_wrap=True)
    for split, label in SPLITS.items():
        figures = metrics.get(split, {})
        table.add_row(label, style="italic")
        for row in ROWS:
            known = figures.get(row, {})
            cells = [_share(known.get(key)) if key in _SHARES else _number(known.get(key)) for key in FIGURES]
            table.add_row(f"  {row}", *cells, style="bold" if row == "tuned" else None)
        table.add_row("  noise floor", _number(figures.get("noise_floor")), style="dim", end_section=True)
    return table


def parameters_table(
    parameters: Mapping[str, float | int], uncertainty: Mapping[str, Mapping[str, Any]]
) -> Any:
    """A rich table of the parameters with intervals, defaults and units. It fits into 80 columns.

    The arguments are the keys `parameters` and `uncertainty` of metrics.json.
    """
    from rich.table import Table

    # Lines between the columns would take the room of the units.
    table = Table(title="Parameters", title_justify="left", box=None, pad_edge=False)
    columns: tuple[tuple[str, JustifyMethod], ...] = (
        ("", "left"),
        ("value", "right"),
        ("90 % interval", "left"),
        ("default", "right"),
        ("unit", "left"),
    )
    for heading, justify in columns:
        table.add_column(heading, justify=justify, no_wrap=heading != "unit")
    for spec in ARTIST_PARAMETERS:
        table.add_row(
            f"{spec.symbol}  {spec.name}",
            f"{parameters[spec.name]:.4g}",
            _sureness(uncertainty.get(spec.name)),
            f"{spec.default:.4g}",
            spec.unit,
            style="bold" if spec.fitted else "dim",
        )
    return table


def _sureness(interval: Mapping[str, Any] | None) -> str:
    if interval is None:
        return ""
    symbols = {spec.name: spec.symbol for spec in ARTIST_PARAMETERS}
    lines = [f"{interval['low']:.3g} to {interval['high']:.3g}"]
    if not interval["determined"]:
        lines.append("not determined")
    if interval["trades_with"]:
        lines.append(f"trades with {', '.join(symbols[name] for name in interval['trades_with'])}")
    return "\n".join(lines)


def error_breakdown_table(document: Mapping[str, Any]) -> tuple[Any, ...]:
    """A rich table of the tuned error by cause, largest first; empty if the error was not split.

    `document` is the content of metrics.json.
    """
    from rich.table import Table

    if "error_breakdown" not in document:
        return ()
    budget = document["error_breakdown"]
    total = document["metrics"]["fitted"]["tuned"]["relmse"]
    table = Table(title=f"Tuned error by cause, {budget['views']} views", title_justify="left")
    table.add_column("", no_wrap=True)
    for heading in ("relMSE", "share"):
        table.add_column(heading, justify="right")
    causes = {cause: value for cause, value in budget.items() if cause != "views"}
    for cause in sorted(causes, key=lambda cause: (cause == "remainder", -causes[cause])):
        share = f"{causes[cause] / total:.0%}" if total > 0.0 else "–"
        table.add_row(cause.replace("_", " "), _number(causes[cause]), share)
    table.add_row("all", _number(total), "100%", style="bold")
    return (table,)


def _share(value: float | None) -> str:
    return "–" if value is None or math.isnan(value) else f"{100.0 * value:.2g} %"


def _number(value: float | None) -> str:
    return "–" if value is None or math.isnan(value) else f"{value:.3g}"
