"""Puts ARCHITECTURE.md, which stands at the top of the repository, into the documentation site.

A hook of mkdocs (mkdocs.yml). Links into docs/ become links within the site; others become plain text, for
the files that they lead to are not part of it.
"""

import re
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "ARCHITECTURE.md"
PAGE = "architecture.md"
_LINK = re.compile(r"\[([^\]]+)\]\(([^)#]+)(#[^)]*)?\)")


def on_page_markdown(markdown: str, page, config, files) -> str:
    """The text of a page: ARCHITECTURE.md for the page that is named after it, else as it is."""
    if page.file.src_uri != PAGE:
        return markdown
    return _LINK.sub(_within_site, SOURCE.read_text(encoding="utf-8"))


def _within_site(link: re.Match[str]) -> str:
    text, target, anchor = link[1], link[2], link[3] or ""
    if target.startswith("docs/"):
        return f"[{text}]({target.removeprefix('docs/')}{anchor})"
    return text
