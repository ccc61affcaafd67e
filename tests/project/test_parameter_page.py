"""docs/parameters.md is what its script makes of the parameter table."""

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]


def test_the_page_is_made_from_the_table(monkeypatch):
    """Else: python scripts/make_parameter_page.py."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    import make_parameter_page

    assert make_parameter_page.PAGE.read_text(encoding="utf-8") == make_parameter_page.page()
