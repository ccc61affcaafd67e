"""Render a template to a self-contained HTML page."""

import base64
import hashlib
import importlib.metadata
from functools import lru_cache
from typing import Any

import jinja2
from markupsafe import Markup

from vpltune.tuner.report import page_text

MAXIMUM_PAGE_BYTES = 8_000_000
"""Largest size of a page. A choice: it opens at once and can be mailed. The page says what is left out."""


def page_html(template: str, style: tuple[str, ...], script: str, **context: Any) -> str:
    """The HTML of a page.

    Args:
        template: File name of the template.
        style: File names of the style sheets, joined in this order.
        script: File name of the script.
        context: Variables of the template. Strings may come from scene files, so they are escaped.
    """
    environment = _environment()
    css = "\n".join(_source(name) for name in style)
    javascript = _source(script)
    return environment.get_template(template).render(
        policy=_policy(css, javascript),
        # Our own files are not escaped: the policy allows them by the hash of their exact text.
        style=Markup(css),
        script=Markup(javascript),
        version=importlib.metadata.version("vpltune"),
        **context,
    )


@lru_cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("vpltune.tuner.report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for wording in (page_text.number, page_text.seconds, page_text.ratio, page_text.words):
        environment.filters[wording.__name__] = wording
    return environment


def _source(name: str) -> str:
    environment = _environment()
    assert environment.loader is not None
    return environment.loader.get_source(environment, name)[0]


def _policy(css: str, javascript: str) -> str:
    """Content security policy that allows our own style and script and embedded images, and nothing else."""
    style, script = (
        base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
        for text in (css, javascript)
    )
    return (
        f"default-src 'none'; img-src data:; style-src 'sha256-{style}'; script-src 'sha256-{script}'; "
        "base-uri 'none'; form-action 'none'"
    )
