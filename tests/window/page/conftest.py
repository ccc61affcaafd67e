"""One browser for all tests of the window's page."""

import pytest
from faked_window import ADDRESS, opened_window
from headless_chromium import headless_chromium


@pytest.fixture(scope="session")
def chromium(playwright):
    with headless_chromium(playwright) as browser:
        yield browser


@pytest.fixture(scope="session")
def run_module(chromium):
    """Runs a function body in the page, with the exports of a module of `window/page/` by their names."""
    with opened_window(chromium) as window:

        def run(module: str, body: str, argument=None):
            # The page's policy forbids eval, but not what the browser's own tools evaluate.
            text = f"async (given) => {{ const m = await import('{ADDRESS}{module}'); {body} }}"
            return window.page.evaluate(text, argument)

        yield run


@pytest.fixture
def window(chromium):
    """The page with the usual scene, and a server that the test plays."""
    with opened_window(chromium) as opened:
        yield opened
        assert opened.problems == []
