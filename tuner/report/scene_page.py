"""The page of one fit: images, figures, parameters, charts and provenance."""

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from vpltune.tuner.evaluation.view_images import VARIANTS
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA
from vpltune.tuner.report.charts import BarChart, bar_chart, loss_chart, pareto_chart
from vpltune.tuner.report.fit_folder import FitFolder, split_figures
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES, page_html
from vpltune.tuner.report.page_text import change, finite, number, seconds, words
from vpltune.tuner.report.parameter_rows import parameter_rows
from vpltune.tuner.report.view_blocks import SHOWN, ViewBlock, view_block

SPLITS = {"fitted": "fitted views, mean", "held_out": "held-out views, mean"}
"""Splits of the views, and their titles in the table of figures."""
FIGURES = {
    "relmse": "relMSE",
    "trimmed_relmse": "without worst 0.1 %",
    "worst_share": "share of worst",
    "median_error": "median pixel",
    "energy_ratio": "energy",
    "flip": "FLIP",
}
"""Figures in that table (`tuner.metrics.view_metrics.ViewMetrics`), and their headings."""
CARDS = {
    "trimmed_relmse": "relMSE without the worst 0.1 %",
    "energy_ratio": "Energy ratio",
    "flip": "HDR-FLIP",
}
"""Figures on the cards at the top, and their titles."""
VISIBILITY_WORDS = {
    "none": "no visibility",
    "transmittance": "exponential extinction only",
    "maps": "visibility maps",
}
"""Visibility modes in words; `none` is from version 1 of the config."""
_NO_IMAGES = "This fit kept no images (images.npz), so there are none to show."
_REST_OF_PAGE = 600_000
"""Bytes reserved for everything but images: tables, charts, style and script. A choice."""


def scene_page(fit: FitFolder, name: str | None = None, library: str | None = None) -> str:
    """The HTML of a fit's page.

    Args:
        fit: Output folder of the fit.
        name: Heading of the page; None for the name of the scene file.
        library: Relative URL of the library's page that links to it; None if there is none.
    """
    document = fit.document
    views, left_out = _views(fit)
    budget, budget_views = _error_breakdown(fit.part("error_breakdown"))
    front = fit.part("pareto")
    return page_html(
        "scene.html.j2",
        ("page.css", "scene.css"),
        "scene.js",
        name=name or scene_name(document),
        library=library,
        status=str(document.get("status", "")),
        sentence=str(document.get("sentence", "")),
        cards=_cards(document),
        total=seconds(fit.part("seconds").get("total")),
        visibility=VISIBILITY_WORDS.get(str(document.get("visibility")), str(document.get("visibility", ""))),
        views=views,
        left_out=left_out,
        no_images=_NO_IMAGES,
        linear=[view.linear for view in views],
        SHOWN=SHOWN,
        diverging=DIVERGING,
        magma=MAGMA,
        figures=_figures(fit),
        figure_names=FIGURES,
        parameters=parameter_rows(fit.part("parameters"), fit.part("uncertainty")),
        has_uncertainty=bool(fit.part("uncertainty")),
        loss_chart=loss_chart(fit.part("loss")),
        pareto_chart=pareto_chart(
            front,
            split_figures(document, "fitted", "ceiling").get("relmse"),
            fit.part("budget").get("budget_milliseconds"),
        ),
        frame_budget=_frame_budget(fit.part("budget")),
        pareto_rows=[_front_row(point) for point in front],
        error_breakdown=budget,
        budget_views=budget_views,
        timings=_timings(fit.part("seconds")),
        notes=[str(note) for note in fit.part("notes")],
        origin=_origin(fit),
    )


def scene_name(document: Mapping[str, Any]) -> str:
    """The name of the scene of a metrics.json: its file name without extension."""
    return PurePath(str(document.get("scene", "scene"))).stem


def _views(fit: FitFolder) -> tuple[list[ViewBlock], str]:
    """The views that fit into the page, and a sentence on those left out; empty if there are none."""
    measured = fit.part("per_view")
    room, shown = MAXIMUM_PAGE_BYTES - _REST_OF_PAGE, []
    for images in fit.images:
        block = view_block(images, measured[images.index] if images.index < len(measured) else {})
        if block.weight > room:
            break
        room -= block.weight
        shown.append(block)
    missing = max(len(measured), len(fit.images)) - len(shown)
    if not shown or not missing:
        return shown, ""
    return (
        shown,
        f"{missing} more views were measured; their images are left out to keep the page small.",
    )


def _cards(document: Mapping[str, Any]) -> list[dict[str, str]]:
    """The figures of `CARDS`, before and after, on held-out views, or fitted views if there are no others."""
    split = "held_out" if split_figures(document, "held_out", "tuned") else "fitted"
    default, tuned, ceiling = (split_figures(document, split, variant) for variant in VARIANTS)
    where = {"held_out": "held-out views", "fitted": "fitted views"}[split]
    cards = []
    for key, what in CARDS.items():
        before, after = default.get(key), tuned.get(key)
        verdict = "" if key == "energy_ratio" else change(before, after)
        notes = [verdict, f"ceiling {number(ceiling.get(key))}"]
        cards.append(
            {
                "what": f"{what}, {where}",
                "before": number(before),
                "after": number(after),
                "note": " · ".join(note for note in notes if note),
            }
        )
    return cards


def _figures(fit: FitFolder) -> list[dict[str, Any]]:
    metrics = fit.part("metrics")
    groups = [
        (title, metrics[split]) for split, title in SPLITS.items() if isinstance(metrics.get(split), dict)
    ]
    groups += [(str(view.get("name", "")), view) for view in fit.part("per_view")]
    return [{"name": name, "rows": _figure_rows(figures)} for name, figures in groups if figures]


def _figure_rows(figures: Mapping[str, Any]) -> list[dict[str, str]]:
    rows = []
    for variant in VARIANTS:
        known = figures.get(variant)
        known = known if isinstance(known, dict) else {}
        rows.append({"variant": variant, **{key: number(known.get(key)) for key in FIGURES}})
    floor = dict.fromkeys(FIGURES, "") | {"relmse": number(figures.get("noise_floor"))}
    return [*rows, {"variant": "noise floor", **floor}]


def _error_breakdown(budget: Mapping[str, Any]) -> tuple[BarChart | None, str]:
    """Bars of the causes in descending order, and the views that they were measured on."""
    causes = {name: value for name, raw in budget.items() if (value := finite(raw)) is not None}
    views = str(budget.get("views", "")).replace("_", " ")
    return bar_chart(dict(sorted(causes.items(), key=lambda cause: -cause[1]))), views


def _timings(stages: Mapping[str, Any]) -> BarChart | None:
    known = {
        name: value for name, value in stages.items() if name != "total" and (finite(value) or 0.0) > 0.0
    }
    return bar_chart(known, seconds)


def _front_row(point: Mapping[str, Any]) -> dict[str, str]:
    parameters = point.get("parameters")
    parameters = parameters if isinstance(parameters, dict) else {}
    return {
        "milliseconds": number(point.get("milliseconds")),
        "relmse": number(point.get("relmse")),
        "vpls": number(point.get("vpl_count", parameters.get("vpl_count")), 5),
        "choice": _choice(point),
        "config": str(point.get("config", "")),
    }


def _choice(point: Mapping[str, Any]) -> str:
    """The settings that were chosen besides the parameters, in words."""
    choice = point.get("choice")
    named = choice.items() if isinstance(choice, dict) else ()
    return ", ".join(
        f"{words(name)} {number(value) if finite(value) is not None else value}" for name, value in named
    )


def _frame_budget(budget: Mapping[str, Any]) -> list[dict[str, str]]:
    """Cards on the frame-time budget and the measured frame; none if there was no budget."""
    if not budget:
        return []
    size = budget.get("frame_size")
    pixels = "×".join(number(side, 5) for side in size) if isinstance(size, list) else ""
    asked, measured = budget.get("budget_milliseconds"), budget.get("milliseconds")
    predicted = f"predicted {number(budget.get('predicted_milliseconds'))} ms"
    return [
        {
            "what": "Budget",
            "after": f"{number(asked)} ms",
            "note": f"at {pixels}" if pixels else "",
        },
        {"what": "Measured", "after": f"{number(measured)} ms", "note": predicted},
        {"what": "VPLs", "after": number(budget.get("vpl_count"), 5), "note": _choice(budget)},
        {
            "what": "relMSE",
            "after": number(budget.get("relmse")),
            "note": "over rotations of the point table that the fit did not use",
        },
    ]


def _origin(fit: FitFolder) -> list[tuple[str, str]]:
    entries = {"scene file": fit.document.get("scene", ""), **fit.part("provenance")}
    return [(words(name), str(value)) for name, value in entries.items() if value not in (None, "")]
