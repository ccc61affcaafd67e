"""Decides what the drawing process does next: what was asked last counts, and clients take turns."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from vpltune.window.client import Client
from vpltune.window.messages import Pane
from vpltune.window.requests import DrawnImage, DrawRequest

MOST_UNSHOWN = 2
"""Images on their way to a browser. A choice: one is drawn while another travels, and no more, so that a
slow browser sees the newest."""

Make = Callable[[Client, Pane], DrawRequest | None]
"""Makes the request for a pane; None where there is nothing to draw."""


class DrawingQueue:
    """One request at a time, the newest of each client and pane.

    Args:
        send: hands a request to the drawing process.
        make: makes the request for a pane of a client as it is now.
    """

    def __init__(self, send: Callable[[Any], None], make: Make):
        self._send, self._make = send, make
        self._asked: deque[Any] = deque()
        self._busy: Any = None
        self._last_client = -1

    def ask(self, request: Any) -> None:
        """Queue a question, which goes before images."""
        self._asked.append(request)

    def drop(self, client: int) -> None:
        """Forget the questions of a client that has gone."""
        self._asked = deque(each for each in self._asked if each.client != client)

    def forget_busy(self) -> None:
        """The drawing process has gone, and with it what it was doing."""
        self._busy = None

    def answered(self) -> None:
        """The drawing process has answered what it was asked."""
        self._busy = None

    def next(self, clients: Iterable[Client]) -> None:
        """Hand out the next piece of work, if the process is idle and there is any."""
        if self._busy is not None:
            return
        if self._asked:
            self._busy = self._asked.popleft()
            self._send(self._busy)
            return
        # Those after the one that was served last go first.
        ready = [each for each in clients if each.wanted and each.unshown < MOST_UNSHOWN]
        for client in sorted(ready, key=lambda each: (each.id <= self._last_client, each.id)):
            # The left pane first: the right one takes its exposure.
            for pane in sorted(client.wanted):
                client.wanted.discard(pane)
                request = self._make(client, pane)
                if request is not None:
                    self._busy, self._last_client = request, client.id
                    self._send(request)
                    return

    @staticmethod
    def is_stale(drawn: DrawnImage, client: Client) -> bool:
        """Whether an image is of no use to the client any more: its page looks at something else by now.

        While things move, every image is shown, or a steady stream of looks would starve the page.
        """
        look = client.look
        if look is None:
            return True
        shown = {"a": look.a, "b": look.b}[drawn.request.pane]
        return shown != drawn.request.source or look.layer != drawn.request.layer
