"""A fit's result as a piece of HTML, for notebooks: tables, a sentence and the comparison image."""

import base64
import io
import math
from typing import TYPE_CHECKING, Any

from jinja2 import Environment
from PIL import Image

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS

if TYPE_CHECKING:
    from vpltune.tuner.scene_fit.fit_result import FitResult

_METRICS = {
    "relmse": "relMSE",
    "trimmed_relmse": "without worst 0.1 %",
    "median_error": "median pixel",
    "energy_ratio": "energy",
    "flip": "FLIP",
}
"""Headings of the metrics (`tuner.metrics.view_metrics.ViewMetrics`)."""
_SPLITS = {"fitted": "fitted views", "held_out": "held-out views"}
_VARIANTS = ("default", "tuned", "ceiling")
# Every value is escaped: names come from scenes, and sentences may hold names.
_TEMPLATE = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
    """\
<div>
<p><b>{{ status }}</b>: {{ sentence }}</p>
<table>
<thead><tr><th>parameter</th><th>start</th><th>result</th><th>90 % interval</th><th>unit</th></tr></thead>
<tbody>
{% for cells in parameters %}
<tr>{% for cell in cells %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</tbody>
</table>
<table>
<thead><tr><th></th>{% for heading in headings %}<th>{{ heading }}</th>{% endfor %}</tr></thead>
<tbody>
{% for cells in metrics %}
<tr>{% for cell in cells %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</tbody>
</table>
{% if notes %}
<ul>
{% for note in notes %}
<li>{{ note }}</li>
{% endfor %}
</ul>
{% endif %}
<img alt="reference, default, tuned and ceiling" style="max-width: 100%" src="{{ image }}">
</div>
"""
)


def result_html(result: "FitResult") -> str:
    """The result as HTML without scripts, with its image inside."""
    return _TEMPLATE.render(
        status=result.status,
        sentence=result.sentence,
        parameters=_parameter_rows(result),
        headings=_METRICS.values(),
        metrics=_metric_rows(result.document["metrics"]),
        notes=result.notes,
        image=_png_uri(result),
    )


def _parameter_rows(result: "FitResult") -> list[tuple[str, ...]]:
    """The parameters that were fitted or changed: name, start, result, interval and unit."""
    before, after = result.start.as_dict(), result.config.parameters.as_dict()
    rows = []
    for spec in ARTIST_PARAMETERS:
        if not spec.fitted and before[spec.name] == after[spec.name]:
            continue
        known = result.document["uncertainty"].get(spec.name)
        interval = "" if known is None else f"{known['low']:.3g} to {known['high']:.3g}"
        if known is not None and not known["determined"]:
            interval += ", not determined"
        values = (f"{values[spec.name]:.4g}" for values in (before, after))
        rows.append((f"{spec.symbol} {spec.name}", *values, interval, spec.unit))
    return rows


def _metric_rows(metrics: dict[str, Any]) -> list[tuple[str, ...]]:
    """Split and variant, then the metrics."""
    return [
        (f"{label}, {variant}", *(_number(metrics[split][variant][name]) for name in _METRICS))
        for split, label in _SPLITS.items()
        if metrics[split]
        for variant in _VARIANTS
    ]


def _number(value: float | None) -> str:
    return "–" if value is None or math.isnan(value) else f"{value:.3g}"


def _png_uri(result: "FitResult") -> str:
    file = io.BytesIO()
    Image.fromarray(result.comparison, "RGB").save(file, "PNG")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode('ascii')}"
