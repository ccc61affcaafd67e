"""How long the page of `vpltune view` takes from an input to its picture, idle and while a fit runs."""

import json
import shutil
import statistics
import struct
import tempfile
import time
from collections.abc import Callable
from typing import Any

import vpltune
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import OWN_SCENES

SIZE = (640, 360)
"""Width and height of the stage, in pixels."""
SECONDS = 20.0
"""Length of each drag. A choice: tens of pictures on a software renderer."""
IDLE_LIMIT, FIT_LIMIT = 1.3, 3.0
"""Most that a picture may take, in times of its frame drawn alone. A choice."""
ANSWER_LIMIT_MS = 100.0
"""Milliseconds in which the server answers anything. A choice: below, it feels immediate."""
_ARGUMENTS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Median and 95th percentile of input to picture ÷ the frame's own time, and of the server's answers.

    A drag turns the camera in a real browser. The picture is there when the page says that it has shown it.
    Idle, each picture is compared with its own frame; during a fit, with the median frame when idle.
    """
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium")
    if program is None:
        raise vpltune.MachineError("bench window: needs chromium on the PATH")
    with (
        tempfile.TemporaryDirectory() as folder,
        sync_playwright() as playwright,
        vpltune.view(shutil.copy(OWN_SCENES[0], folder)) as window,
    ):
        browser = playwright.chromium.launch(executable_path=program, args=list(_ARGUMENTS))
        page = browser.new_page(viewport={"width": 1100, "height": 520})
        traffic = _Traffic()
        page.on("websocket", traffic.follow)
        page.goto(window.address)
        page.wait_for_function("() => document.querySelector('#label-a').textContent.includes('settled')")
        page.evaluate(
            f"""() => {{
                const stage = document.querySelector('#stage').style;
                stage.flex = 'none'; stage.width = '{SIZE[0]}px'; stage.height = '{SIZE[1]}px';
            }}"""
        )
        # The first frames find the effort that the machine can do, and compile what it needs.
        _drag(page, SECONDS / 2.0)
        progress("window", 0.2)
        traffic.forget()
        _drag(page, SECONDS)
        idle = traffic.pictures()
        frame = statistics.median(each.milliseconds for each in idle)
        progress("window", 0.5)
        page.locator("#tune").click()
        time.sleep(2.0)
        traffic.forget()
        _drag(page, SECONDS)
        busy = traffic.pictures()
        answers = traffic.answers
        browser.close()
    own = [each.latency / each.milliseconds for each in idle]
    during = [each.latency / frame for each in busy]
    progress("window", 1.0)
    return [
        Row("frame_in_motion_ms", frame, "ms", "ten frames a second", 100.0),
        Row("idle_median", statistics.median(own), "x", "limit", IDLE_LIMIT),
        Row("idle_95th", _percentile(own), "x", "limit", IDLE_LIMIT),
        Row("during_fit_median", statistics.median(during), "x", "limit", FIT_LIMIT),
        Row("during_fit_95th", _percentile(during), "x", "limit", FIT_LIMIT),
        Row("answer_during_fit_ms", max(answers, default=float("nan")), "ms", "limit", ANSWER_LIMIT_MS),
    ]


class _Picture:
    """One shown image: from its look to the page's word that it is shown, and its frame's own time."""

    def __init__(self, latency: float, milliseconds: float):
        self.latency, self.milliseconds = latency, milliseconds


class _Traffic:
    """The messages of a page's socket, with the times at which they passed."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self._looks: dict[int, float] = {}
        self._frames: dict[int, float] = {}
        self._shown: dict[int, float] = {}
        self._asked: dict[int, float] = {}
        self.answers: list[float] = []

    def follow(self, socket: Any) -> None:
        socket.on("framesent", self._sent)
        socket.on("framereceived", self._received)

    def pictures(self) -> list[_Picture]:
        """All that were shown. Raises MachineError if none was."""
        found = [
            _Picture(1e3 * (shown - self._looks[look]), self._frames[look])
            for look, shown in self._shown.items()
            if look in self._looks and look in self._frames
        ]
        if not found:
            raise vpltune.MachineError("bench window: no picture was shown")
        return found

    def _sent(self, payload: str | bytes) -> None:
        now = time.perf_counter()
        message = json.loads(payload)
        if message["type"] == "look" and message["moving"]:
            self._looks[message["look"]] = now
        elif message["type"] == "shown":
            self._shown.setdefault(message["look"], now)
        elif message["type"] == "edit":
            self._asked[0] = now

    def _received(self, payload: str | bytes) -> None:
        if isinstance(payload, bytes):
            (length,) = struct.unpack("<I", payload[:4])
            header = json.loads(payload[4 : 4 + length])
            if not header["settled"]:
                self._frames.setdefault(header["look"], header["milliseconds"])
        elif self._asked and json.loads(payload)["type"] == "state":
            self.answers.append(1e3 * (time.perf_counter() - self._asked.pop(0)))


def _drag(page: Any, seconds: float) -> None:
    """Turn the camera to and fro for so long; now and then change a parameter."""
    box = page.locator("#stage").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    until = time.monotonic() + seconds
    step = 0
    while time.monotonic() < until:
        page.mouse.move(x, y)
        page.mouse.down()
        for _ in range(40):
            step += 1
            page.mouse.move(x + 30.0 * (step % 8), y)
            page.wait_for_timeout(30)
        page.mouse.up()
        page.locator('[data-parameter="intensity"] input[type=range]').focus()
        page.keyboard.press("ArrowRight" if step % 80 else "ArrowLeft")


def _percentile(values: list[float]) -> float:
    return statistics.quantiles(values, n=20)[-1] if len(values) > 1 else values[0]
