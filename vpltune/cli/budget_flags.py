"""Flags `--vpl-count`, `--budget-ms`, `--pareto` and `--frame-size` of `vpltune fit`, and their output."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from vpltune.cli.options import parse_size
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.tuner.frame_time.fit_budget import BudgetOptions


def with_vpl_count(config: TunedConfig, vpl_count: int | None) -> TunedConfig:
    """`config` with this VPL count; None keeps the config's own."""
    if vpl_count is None:
        return config
    return replace(config, parameters=replace(config.parameters, vpl_count=vpl_count))


def budget_from_flags(
    vpl_count: int | None, budget_ms: float | None, pareto: bool, frame_size: str | None
) -> BudgetOptions | None:
    """The budget that the flags ask for; None if they ask for none.

    Raises:
        InputError: a flag lacks the one that it needs, two exclude each other, or a value is out of range.
    """
    if budget_ms is None and not pareto:
        if frame_size is not None:
            raise InputError("--frame-size: needs --budget-ms or --pareto")
        return None
    if vpl_count is not None:
        raise InputError(
            f"--vpl-count: a budget picks the count, so it cannot be given with one; got {vpl_count}"
        )
    if budget_ms is not None and not 0.0 < budget_ms < math.inf:
        raise InputError(f"--budget-ms: must be a positive number of milliseconds, got {budget_ms}")
    return BudgetOptions(budget_ms, pareto, None if frame_size is None else parse_size(frame_size))


def budget_lines(document: Mapping[str, Any]) -> tuple[Any, ...]:
    """The lines and the table that `vpltune fit` prints for density, budget and front."""
    lines: list[Any] = []
    if "density" in document:
        errors = document["density"]["held_out_relmse"]
        lines.append(
            f"{document['density']['vpl_count']} VPLs, on held-out rotations: relMSE "
            f"{errors['tuned']:.3g}, default {errors['default']:.3g}"
        )
    if "budget" in document:
        budget = document["budget"]
        choice = budget["choice"]
        lines.append(
            f"{budget['milliseconds']:.3g} ms of {budget['budget_milliseconds']:g}: "
            f"{budget['vpl_count']} VPLs, interleave {choice['interleave']}, RSM {choice['rsm_resolution']}²"
        )
    if "pareto" in document:
        lines.append(_front_table(document["pareto"]))
    return tuple(lines)


def _front_table(points: list[Mapping[str, Any]]) -> Any:
    from rich.table import Table

    table = Table(title="Error against frame time", title_justify="left")
    for heading in ("ms", "relMSE", "VPLs", "interleave", "maps", "RSM", "config"):
        table.add_column(heading, justify="left" if heading == "config" else "right")
    for point in points:
        choice = point["choice"]
        table.add_row(
            f"{point['milliseconds']:.3g}",
            f"{point['relmse']:.3g}",
            str(point["vpl_count"]),
            str(choice["interleave"]),
            str(choice["map_size"]),
            str(choice["rsm_resolution"]),
            point["config"],
        )
    return table
