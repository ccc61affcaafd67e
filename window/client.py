"""One browser: what it wants to see, and what it has been sent."""

import asyncio
from collections import deque
from dataclasses import dataclass, field

from vpltune.window.effort import FIRST_EFFORT
from vpltune.window.messages import PANES, Look, Pane, Source

STATE = '{"type": "state"'
"""How a `state` message begins."""


@dataclass(eq=False)
class Client:
    """The state of one connection."""

    id: int
    look: Look | None = None
    wanted: set[Pane] = field(default_factory=set)
    """Panes whose image is older than the look or the document."""
    unshown: int = 0
    """Images sent that the browser has not shown yet."""
    effort: int = FIRST_EFFORT
    """Index of the effort of frames in motion."""
    _outbox: deque[str | bytes] = field(default_factory=deque)
    _posted: asyncio.Event = field(default_factory=asyncio.Event)

    def post(self, message: str | bytes) -> None:
        """Queue a message for the browser. A newer state takes the place of one that it has not got yet."""
        if isinstance(message, str) and message.startswith(STATE):
            old = next(
                (each for each in self._outbox if isinstance(each, str) and each.startswith(STATE)), None
            )
            if old is not None:
                self._outbox.remove(old)
        self._outbox.append(message)
        self._posted.set()

    async def posted(self) -> str | bytes:
        """The next message for the browser, as soon as there is one."""
        while not self._outbox:
            self._posted.clear()
            await self._posted.wait()
        return self._outbox.popleft()

    def see(self, look: Look) -> None:
        """Take the newest look: both panes are wanted anew."""
        self.look = look
        self.refresh()

    def refresh(self) -> None:
        """Draw all panes anew: the document has changed, or the look has."""
        if self.look is not None:
            self.wanted = {pane for pane in PANES if self.source_of(pane) is not None}

    def source_of(self, pane: Pane) -> Source | None:
        """What a pane shows; None for a pane that there is not."""
        return None if self.look is None else {"a": self.look.a, "b": self.look.b}[pane]

    def panes_of(self, sources: tuple[Source, ...]) -> set[Pane]:
        """The panes that show one of `sources`."""
        return {pane for pane in PANES if self.source_of(pane) in sources}
