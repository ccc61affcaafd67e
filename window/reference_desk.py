"""Keeps the references that clients look at, and has them rendered one at a time."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vpltune.renderer.scene.views import View, camera_to_json, light_to_json
from vpltune.window.requests import ReferenceRequest, ReferenceStep


@dataclass(eq=False)
class _Entry:
    key: str
    request: ReferenceRequest
    path: Path | None = None
    share: float = 0.0
    noise: float | None = None


class ReferenceDesk:
    """The reference of each client's newest look.

    Args:
        send: hands a request to the process that renders, which drops what it was doing.
    """

    def __init__(self, send: Callable[[ReferenceRequest], None]):
        self._send = send
        self._entries: dict[int, _Entry] = {}
        self._current: int | None = None

    def want(self, request: ReferenceRequest) -> None:
        """Have a view's reference rendered, unless it is there or on its way."""
        key = _key(request)
        known = self._entries.get(request.client)
        if known is not None and known.key == key:
            return
        self._remove(request.client)
        self._entries[request.client] = _Entry(key, request)
        if self._current is None or self._current == request.client:
            self._start(request.client)

    def found(self, request: ReferenceRequest) -> tuple[Path | None, float, float | None]:
        """The file of a view's reference so far, the share of the work done, and the relMSE of its noise."""
        known = self._entries.get(request.client)
        if known is None or known.key != _key(request):
            return None, 0.0, None
        return known.path, known.share, known.noise

    def step(self, step: ReferenceStep) -> bool:
        """Take a report; returns whether it is of what the client still looks at."""
        client = step.request.client
        known = self._entries.get(client)
        current = known is not None and known.request is not None and known.key == _key(step.request)
        if known is not None and current:
            old = known.path
            known.share, known.noise = step.share, step.noise
            if step.path is not None:
                known.path = step.path
                if old is not None:
                    old.unlink(missing_ok=True)
        elif step.path is not None:
            step.path.unlink(missing_ok=True)
        if step.share >= 1.0 and self._current == client and current:
            self._current = None
            self._start_next()
        return current

    def drop(self, client: int) -> None:
        """Forget a client that has gone."""
        self._remove(client)
        if self._current == client:
            self._current = None
            self._start_next()

    def restart(self) -> None:
        """All references are of another scene, or their process has gone: begin anew when asked."""
        for client in list(self._entries):
            self._remove(client)
        self._current = None

    def _start(self, client: int) -> None:
        self._current = client
        self._send(self._entries[client].request)

    def _start_next(self) -> None:
        waiting = next((client for client, each in self._entries.items() if each.share < 1.0), None)
        if waiting is not None:
            self._start(waiting)

    def _remove(self, client: int) -> None:
        entry = self._entries.pop(client, None)
        if entry is not None and entry.path is not None:
            entry.path.unlink(missing_ok=True)


def _key(request: ReferenceRequest) -> str:
    """All that the reference depends on, as text."""
    view: View = request.view
    lights = [light_to_json(light) for light in view.lights]
    return repr((view.size, camera_to_json(view.camera), lights, request.seconds, request.bounces))
