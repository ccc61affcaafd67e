"""A page in a browser, with everything that it says and asks for on record."""

import contextlib
import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image


@dataclass
class OpenedPage:
    page: Any
    problems: list[str] = field(default_factory=list)
    """Console errors and warnings, uncaught exceptions, dialogs."""
    requests: list[str] = field(default_factory=list)
    """Addresses asked for, but those that lie in the page."""

    def drawn(self, state: str) -> None:
        """Wait until images are drawn as `state`, for example "image 0"."""
        self.page.wait_for_function("state => document.documentElement.dataset.drawn === state", arg=state)

    def canvas(self, variant: str, view: int = 0) -> np.ndarray:
        """The pixels of a canvas, [height, width, 3]."""
        width, height, values = self.page.evaluate(
            """([variant, view]) => {
              const article = document.querySelectorAll(".view")[view];
              const canvas = article.querySelector(`.stack canvas[data-variant=${variant}]`);
              const image = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
              return [canvas.width, canvas.height, [...image.data]];
            }""",
            [variant, view],
        )
        return np.array(values, np.uint8).reshape(height, width, 4)[..., :3]

    def photograph(self, selector: str) -> np.ndarray:
        """What is seen of an element, [height, width, 3]."""
        with Image.open(io.BytesIO(self.page.locator(selector).first.screenshot())) as image:
            return np.asarray(image.convert("RGB"))


@contextlib.contextmanager
def opened(
    browser: Any, path: Path, *, ready: str | None = "image 0", **context: Any
) -> Iterator[OpenedPage]:
    """Open a file; `ready` is the state to wait for, and `context` what playwright's `new_context` takes."""
    with contextlib.closing(browser.new_context(**context)) as held:
        page = held.new_page()
        shown = OpenedPage(page)
        address = path.resolve().as_uri()
        page.on("console", lambda message: shown.problems.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: shown.problems.append(str(error)))
        page.on("dialog", lambda dialog: (shown.problems.append(dialog.message), dialog.dismiss()))
        page.on(
            "request",
            lambda request: (
                request.url == address
                or request.url.startswith("data:")
                or shown.requests.append(request.url)
            ),
        )
        page.goto(address)
        if ready is not None:
            shown.drawn(ready)
        yield shown
