"""Draw docs/report.png: the report of a scene beside that of its library.

Run `python scripts/make_report_image.py`. Fits the shipped scenes with `vpltune batch`, writes their pages
with `vpltune report`, and takes screenshots of two pages in the system's Chromium.
"""

import io
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Literal

from PIL import Image
from playwright.sync_api import Browser, ViewportSize, sync_playwright

from vpltune.cli.program import run

REPOSITORY = Path(__file__).resolve().parents[1]
SCENES = REPOSITORY / "configs" / "scenes"
IMAGE = REPOSITORY / "docs" / "report.png"
SHOWN = "gallery"
"""The scene whose page is shown."""
SIZE = ViewportSize(width=1180, height=1180)
"""The browser's window in pixels. A choice."""
SCALE = 0.6
"""Size of the image over that of the screenshots. A choice."""
STEP = 4
"""Distance of neighbouring colour values: six bits a channel look the same, and the file is a third
smaller."""
SETTLING_MS = 1000
"""Milliseconds until the page's images are drawn. A choice."""


def main() -> None:
    """Fit, report, take the screenshots, and write the image."""
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("no chromium; run: apt-get install chromium")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if run(["batch", str(SCENES), "-o", str(folder)]) or run(["report", str(folder)]):
            sys.exit("the shipped scenes could not be fitted")
        (scene,) = folder.glob(f"scenes/{SHOWN}-*/report.html")
        with sync_playwright() as playwright:
            arguments = ["--headless", "--no-sandbox", "--disable-gpu"]
            browser = playwright.chromium.launch(executable_path=chromium, args=arguments)
            pages = [
                photograph(browser, scene, "light", ".view"),
                # Without the path of the library, which is a temporary folder.
                photograph(
                    browser, folder / "index.html", "dark", "table", without="main > section:has(.origin)"
                ),
            ]
            browser.close()
    image = Image.new("RGB", (sum(page.width for page in pages), pages[0].height))
    for index, page in enumerate(pages):
        image.paste(page, (index * page.width, 0))
    image = image.resize((round(SCALE * image.width), round(SCALE * image.height)), Image.Resampling.LANCZOS)
    steps = [min(255, (value + STEP // 2) // STEP * STEP) for value in range(256)]
    image = image.point(steps * len(image.getbands()))
    image.save(IMAGE, optimize=True)
    print(f"wrote {IMAGE} ({IMAGE.stat().st_size // 1000} kB)")


def photograph(
    browser: Browser, page_path: Path, scheme: Literal["light", "dark"], shown: str, without: str = ""
) -> Image.Image:
    """A screenshot of a page, taken when `shown` exists; the element that `without` selects is removed."""
    page = browser.new_context(viewport=SIZE, color_scheme=scheme).new_page()
    page.goto(page_path.as_uri())
    page.wait_for_selector(shown)
    page.wait_for_timeout(SETTLING_MS)
    if without:
        page.evaluate("selector => document.querySelector(selector).remove()", without)
    return Image.open(io.BytesIO(page.screenshot()))


if __name__ == "__main__":
    main()
