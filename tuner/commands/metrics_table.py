"""The table that `fit` and `evaluate` end with."""

from collections.abc import Mapping
from typing import Any

from renderer.artist_parameters import ARTIST_PARAMETERS

ROWS = ("default", "tuned", "ceiling")
SPLITS = {"fitted": "fitted", "held_out": "held out"}


def metrics_table(metrics: Mapping[str, Any]) -> Any:
    """A rich table of relMSE, energy ratio and FLIP: default, tuned and ceiling, and the noise floor."""
    from rich.table import Table

    table = Table(title="Against the path tracer, on views fitted and views held out", title_justify="left")
    table.add_column("", no_wrap=True)
    for label in SPLITS.values():
        for name in ("relMSE", "energy", "FLIP"):
            table.add_column(f"{label}\n{name}", justify="right")
    for row in ROWS:
        cells = [
            _number(metrics.get(split, {}).get(row, {}).get(key))
            for split in SPLITS
            for key in ("relmse", "energy_ratio", "flip")
        ]
        table.add_row(row, *cells, style="bold" if row == "tuned" else None)
    floors = [_number(metrics.get(split, {}).get("noise_floor")) for split in SPLITS]
    table.add_row("noise floor", floors[0], "", "", floors[1], "", "", style="dim")
    return table


def parameters_table(parameters: Mapping[str, float | int]) -> Any:
    """A rich table of the parameters, their defaults and units."""
    from rich.table import Table

    table = Table(title="Parameters", title_justify="left")
    table.add_column("", no_wrap=True)
    for heading, justify in (("value", "right"), ("default", "right"), ("unit", "left")):
        table.add_column(heading, justify=justify)
    for spec in ARTIST_PARAMETERS:
        row = (f"{parameters[spec.name]:.4g}", f"{spec.default:.4g}", spec.unit)
        table.add_row(f"{spec.symbol}  {spec.name}", *row, style="bold" if spec.fitted else "dim")
    return table


def _number(value: Any) -> str:
    return "–" if value is None else f"{value:.3g}"
