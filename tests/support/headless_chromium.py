"""A real browser without a window, for tests of pages."""

import contextlib
import os
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Playwright

ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # Containers give /dev/shm 64 MB, which a long page may fill.
    "--disable-dev-shm-usage",
)


@contextlib.contextmanager
def headless_chromium(playwright: Playwright, *more: str) -> Iterator[Browser]:
    """The system's Chromium, started with `more` arguments; skips where there is none to be had.

    `playwright` is the fixture of that name: a process cannot start a second one while the first is there.
    """
    program = shutil.which("chromium")
    if program is None:
        reason = "no chromium; run: apt-get install chromium"
        # Root's set-up installs it, so its absence is a failure; others were told how to get it.
        (pytest.fail if os.geteuid() == 0 else pytest.skip)(reason)
    browser = playwright.chromium.launch(executable_path=program, args=[*ARGUMENTS, *more])
    try:
        yield browser
    finally:
        browser.close()
