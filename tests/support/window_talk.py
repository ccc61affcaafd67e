"""Talks to a window's server as its page does."""

import io
import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image
from websockets.sync.client import connect

LONGEST_WAIT = 300.0
"""Seconds until a message is given up. Nothing should take so long on any machine."""


@dataclass(frozen=True)
class ShownImage:
    """An image message."""

    header: dict[str, Any]
    data: bytes

    @property
    def pixels(self) -> np.ndarray:
        return np.asarray(Image.open(io.BytesIO(self.data)))


class Talk:
    """One connection. Every image is acknowledged as soon as it is read."""

    def __init__(self, address: str):
        self._address = address.replace("http", "ws", 1).rstrip("/") + "/socket"
        self.notices: list[dict[str, Any]] = []
        self.images: list[ShownImage] = []
        self._look = 0

    def __enter__(self) -> "Talk":
        self._connection = connect(self._address, max_size=None, compression=None)
        self._socket = self._connection.__enter__()
        self.scene = self.message("scene")
        self.state = self.message("state")
        return self

    def __exit__(self, *error: Any) -> None:
        self._connection.__exit__(*error)

    def say(self, type: str, **members: Any) -> None:
        self._socket.send(json.dumps({"type": type, **members}))

    def say_text(self, text: str) -> None:
        self._socket.send(text)

    def look(self, **members: Any) -> int:
        """Send a look, and return its number."""
        self._look += 1
        usual = {
            "camera": self.scene["camera"],
            "size": [96, 64],
            "moving": False,
            "a": "hand",
            "b": None,
            "layer": "final",
            "error_of": "hand",
            "seconds": None,
        }
        self.say("look", look=self._look, **(usual | members))
        return self._look

    def image(self, look: int, pane: str = "a") -> ShownImage:
        """The first image of a look, or of a later one."""
        while True:
            kind, found = self._next()
            if kind == "image" and found.header["look"] >= look and found.header["pane"] == pane:
                return found

    def shown(self, **members: Any) -> ShownImage:
        """Look, and wait for the image."""
        return self.image(self.look(**members))

    def message(self, kind: str) -> dict[str, Any]:
        """The next message of a type."""
        while True:
            found_kind, found = self._next()
            if found_kind == kind:
                return found

    def edit(self, **members: Any) -> dict[str, Any]:
        """Edit, and return the state that follows."""
        self.say("edit", **members)
        return self.message("state")

    def _next(self) -> tuple[str, Any]:
        message = self._socket.recv(timeout=LONGEST_WAIT)
        if isinstance(message, bytes):
            (length,) = struct.unpack("<I", message[:4])
            image = ShownImage(json.loads(message[4 : 4 + length]), message[4 + length :])
            self.images.append(image)
            self.say("shown", look=image.header["look"])
            return "image", image
        found = json.loads(message)
        if found["type"] == "notice":
            self.notices.append(found)
        if found["type"] == "state":
            self.state = found
        return found["type"], found
