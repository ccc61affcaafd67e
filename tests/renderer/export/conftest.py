"""A browser for exported pages."""

import pytest
from exported_page import SOFTWARE_GL
from headless_chromium import headless_chromium


@pytest.fixture(scope="module")
def browser(playwright):
    with headless_chromium(playwright, *SOFTWARE_GL) as browser:
        yield browser


@pytest.fixture
def opened(browser, tmp_path):
    """Opens a page's text as a file, and hands back the browser's page once the image is whole."""
    pages, asked, complaints = [], [], []

    def open_page(text, **options):
        path = tmp_path / "page.html"
        path.write_text(text, encoding="utf-8")
        page = browser.new_page(**options)
        pages.append(page)
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: message.type == "error" and complaints.append(message.text))
        page.goto(path.as_uri())
        page.evaluate("window.started")
        return page

    yield open_page
    for page in pages:
        page.close()
    assert complaints == []
    # The page itself, and not one thing more; its icon is inside.
    assert [url for url in asked if not url.startswith(("file://", "data:"))] == []
    assert len([url for url in asked if url.startswith("file://")]) == len(pages)
