"""The page of the window in a browser, with a server that a test plays: nothing leaves the machine."""

import contextlib
import io
import json
import mimetypes
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image

PAGE = Path(__file__).resolve().parents[2] / "window" / "page"
ADDRESS = "http://window.test/"
"""An address of no machine: every request to it is answered here."""
CONTENT_SECURITY_POLICY = "default-src 'self'; img-src 'self' blob:"
CAMERA = {"to_world": [1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 5, 0, 0, 0, 1], "yfov": 1.0}
"""At (0, 1, 5), along −Z."""
PARAMETERS = [
    {
        "name": "intensity",
        "symbol": "k",
        "unit": "1",
        "meaning": "scales all VPLs",
        "scale": "log",
        "low": 0.05,
        "high": 20.0,
        "default": 1.0,
        "whole_number": False,
        "fitted": True,
    },
    {
        "name": "vpl_count",
        "symbol": "N",
        "unit": "VPLs",
        "meaning": "how many VPLs are drawn",
        "scale": "log",
        "low": 1,
        "high": 65536,
        "default": 512,
        "whole_number": True,
        "fitted": False,
    },
]
SPOT = {
    "type": "spot",
    "position": [0.0, 1.0, 0.0],
    "direction": [0.0, -1.0, 0.0],
    "intensity": [4.0, 2.0, 1.0],
    "inner_cone": 0.3,
    "outer_cone": 0.6,
    "range": 2.5,
}


def scene_message(**members: Any) -> dict[str, Any]:
    """A `scene` with a box of 4 × 2 × 4 units and the two parameters above."""
    return {
        "type": "scene",
        "name": "hall.glb",
        "path": "/scenes/hall.glb",
        "bounds": [[-2, 0, -2], [2, 2, 2]],
        "seconds": 0,
        "parameters": PARAMETERS,
        "qualities": [
            {"name": "interleave", "meaning": "side of a block", "choices": ["auto", 1, 2]},
            {"name": "map_size", "meaning": "texels of a map", "low": 4, "high": 64},
        ],
        "layers": ["image", "albedo"],
        "renderer": "a test",
        "camera": CAMERA,
        "tuning": None,
        "paths": {
            "config": "/scenes/tuned.json",
            "sidecar": "/scenes/lights.json",
            "views": "/scenes/views.json",
        },
        **members,
    }


def config_message(**parameters: float) -> dict[str, Any]:
    """A config as `state` has it: defaults, but for `parameters`."""
    return {
        "parameters": {"intensity": 1.0, "vpl_count": 512, **parameters},
        "quality": {"interleave": "auto", "map_size": 32},
        "intervals": {},
        "status": "",
        "sentence": "",
    }


def state_message(**members: Any) -> dict[str, Any]:
    """A `state` with one spot, and without a fit or a prior."""
    return {
        "type": "state",
        "configs": {"default": config_message(), "tuned": None, "hand": config_message(), "auto": None},
        "lights": [SPOT],
        "views": [{"name": "door", "split": "kept", "camera": {**CAMERA, "yfov": 0.8}}],
        "unsaved": False,
        "unsaved_lights": False,
        "unsaved_views": False,
        "can_undo": False,
        "can_redo": False,
        "undo_name": "",
        "redo_name": "",
        "budget_ms": None,
        "fit": {
            "running": False,
            "stage": "",
            "share": 0.0,
            "seconds_left": None,
            "losses": [],
            "parameters": None,
            "status": "",
            "sentence": "",
        },
        **members,
    }


@dataclass
class FakedWindow:
    """The page, and the server's end of its socket."""

    page: Any
    scene: dict[str, Any]
    state: dict[str, Any]
    received: list[dict[str, Any]] = field(default_factory=list)
    """Messages from the page, in their order."""
    problems: list[str] = field(default_factory=list)
    """Console messages and uncaught exceptions."""
    surface: dict[str, Any] | None = None
    """What every `pick` is answered with; None leaves it unanswered."""
    socket: Any = None
    rested: int = 0
    """Looks that had been sent when the page was last waited for to be at rest."""

    def connected(self, socket: Any) -> None:
        """Greet a page that has opened its socket, and record what it says."""
        self.socket = socket
        socket.on_message(self._told)
        self.send(self.scene)
        self.send(self.state)

    def _told(self, text: str) -> None:
        message = json.loads(text)
        self.received.append(message)
        if message["type"] == "pick" and self.surface is not None:
            self.send({"type": "picked", "id": message["id"], **self.surface})

    def send(self, message: dict[str, Any]) -> None:
        """Send a JSON message to the page."""
        self.socket.send(json.dumps(message))

    def send_image(self, color: tuple[int, int, int] | None, **header: Any) -> None:
        """Send an image of one colour that answers the newest look; without a colour, a header alone."""
        look = self.sent("look")[-1]
        members = {
            "pane": "a",
            "source": look["a"],
            "look": look["look"],
            "size": [64, 48],
            "settled": True,
            "milliseconds": 12.0,
            "camera": look["camera"],
            "lights": None,
            "parameters": None,
            **header,
        }
        encoded = io.BytesIO()
        if color is not None:
            Image.new("RGB", (64, 48), color).save(encoded, "PNG")
        document = json.dumps(members).encode()
        self.socket.send(struct.pack("<I", len(document)) + document + encoded.getvalue())

    def sent(self, kind: str) -> list[dict[str, Any]]:
        """The messages of a type that the page has sent so far."""
        return [message for message in self.received if message["type"] == kind]

    def wait_for(self, condition: Any, what: str) -> None:
        """Let the page run until a condition holds; 10 s are far more than it needs."""
        for _ in range(500):
            if condition():
                return
            self.page.wait_for_timeout(20)
        raise AssertionError(f"never: {what}; received {self.received[-5:]}")

    def wait_for_rest(self) -> None:
        """Wait for a look, sent since the last call, that says that the user has stopped."""
        self.wait_for(
            lambda: len(self.sent("look")) > self.rested and not self.sent("look")[-1]["moving"],
            "a look at rest",
        )
        self.rested = len(self.sent("look"))

    def forget(self) -> None:
        """Begin the record of messages anew."""
        self.received.clear()
        self.rested = 0

    def colour_at(self, x: float, y: float) -> list[int]:
        """The canvas's colour at a place in [0, 1]²: red, green, blue."""
        return self.page.evaluate(
            """([x, y]) => {
              const canvas = document.querySelector("#image");
              const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
              copy.drawImage(canvas, -Math.floor(x * canvas.width), -Math.floor(y * canvas.height));
              return [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);
            }""",
            [x, y],
        )

    def place(self, x: float, y: float) -> tuple[float, float]:
        """The place of the page, in pixels, of a place in [0, 1]² of the stage."""
        box = self.page.locator("#stage").bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 5) -> None:
        """Press the left button at `start` of the page, move and let go at `end`."""
        self.page.mouse.move(*start)
        self.page.mouse.down()
        for step in range(1, steps + 1):
            share = step / steps
            self.page.mouse.move(*(a + (b - a) * share for a, b in zip(start, end, strict=True)))
            # A frame, so that a drag is more than one edit.
            self.page.wait_for_timeout(20)
        self.page.mouse.up()


def _answer(route: Any) -> None:
    name = route.request.url.removeprefix(ADDRESS).partition("?")[0] or "index.html"
    path = PAGE / name
    kind = "text/javascript" if path.suffix == ".js" else mimetypes.guess_type(path.name)[0]
    headers = {"Content-Security-Policy": CONTENT_SECURITY_POLICY, "Content-Type": kind or ""}
    route.fulfill(body=path.read_bytes(), headers=headers) if path.is_file() else route.fulfill(status=404)


@contextlib.contextmanager
def opened_window(
    browser: Any,
    scene: dict[str, Any] | None = None,
    state: dict[str, Any] | None = None,
    **context: Any,
) -> Iterator[FakedWindow]:
    """Open the page and greet it; `context` is what playwright's `new_context` takes."""
    context.setdefault("viewport", {"width": 1200, "height": 800})
    with contextlib.closing(browser.new_context(**context)) as held:
        page = held.new_page()
        # None of its own: a busy machine takes as long as it takes.
        page.set_default_timeout(0)
        window = FakedWindow(page, scene or scene_message(), state or state_message())
        page.on("console", lambda message: window.problems.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: window.problems.append(str(error)))
        page.route(ADDRESS + "**", _answer)
        page.route_web_socket("ws://window.test/socket", window.connected)
        page.goto(ADDRESS)
        window.wait_for_rest()
        # The look at rest may come before the first state.
        page.wait_for_function("() => document.querySelector('input.number')?.value")
        yield window
