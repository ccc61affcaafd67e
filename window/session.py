"""A window's session: the document, the browsers that look at it, and the processes that work for it."""

import asyncio
import functools
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import PRESETS, TunedConfig, read_config
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files import unfinished_files
from vpltune.renderer.scene.views import View, camera_from_json
from vpltune.tuner.doctor.extras import how_to_install, missing_modules
from vpltune.window import messages, wire
from vpltune.window.client import Client
from vpltune.window.crew import Crew
from vpltune.window.document import Document, Edited
from vpltune.window.drawing_queue import DrawingQueue
from vpltune.window.effort import EFFORTS, next_effort
from vpltune.window.file_desk import FileDesk, config_file
from vpltune.window.fit_desk import FitDesk
from vpltune.window.messages import Look, Pane
from vpltune.window.reference_desk import ReferenceDesk
from vpltune.window.requests import (
    DrawnImage,
    DrawRequest,
    Failed,
    FitRequest,
    Measured,
    MeasureRequest,
    Picked,
    PickRequest,
    ReferenceRequest,
    ReferenceStep,
    SceneCard,
    SceneSource,
)


@dataclass(frozen=True, eq=False)
class WindowOptions:
    """What a window is opened with."""

    source: SceneSource
    config: str | Path | TunedConfig = "default"
    """Where the config by hand begins: a file, a preset's name, or a config."""
    output: Path | None = None
    """Folder to save to; None is that of the config file, or out/SCENE."""


class Session:
    """One window. Its methods are called in the event loop, and none of them waits.

    Args:
        options: what the window is opened with.
        tell: called with each line for whoever started the window.

    Raises:
        InputError: the config cannot be used.
    """

    def __init__(self, options: WindowOptions, tell: Callable[[str], None]):
        self._source, self._tell = options.source, tell
        self._presets = {name: read_config(name) for name in PRESETS}
        self.document = Document(Edited(_config(options.config), ()))
        file = config_file(options.config)
        if file is not None or isinstance(options.config, TunedConfig):
            self.document.tuned = self.document.now.config
        self.card: SceneCard | None = None
        self.opened: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done once the scene is there; holds the error if it cannot be used."""
        self.clients: dict[int, Client] = {}
        self._folder = unfinished_files.new_folder(Path(tempfile.gettempdir()))
        self._crew = Crew(
            options.source,
            self._folder,
            card=self._opened,
            failed=lambda reason: self.opened.set_exception(InputError(reason)),
            answered=self._answered,
            traced=self._traced,
            notify=self.notify,
        )
        self._queue = DrawingQueue(self._crew.draw, self._request)
        self._references = ReferenceDesk(self._crew.trace)
        self._fit = FitDesk(self._folder / "fit", self._fit_changed, self.notify)
        self._files = FileDesk(
            self.document,
            options.source.path,
            file,
            options.output,
            fit_result=self._fit.result_for,
            scene_changed=self._crew.read_again,
            changed=self._document_changed,
            notify=self.notify,
        )
        edit = functools.partial(messages.edit, presets=self._presets)
        self._handlers: dict[str, Callable[[Client, dict[str, Any]], None]] = {
            "look": self._look,
            "shown": self._shown,
            "edit": lambda _, message: self._edit(lambda: edit(self.document, message)),
            "undo": lambda _, __: self._edit(self.document.undo),
            "redo": lambda _, __: self._edit(self.document.redo),
            "keep_view": lambda _, message: self._edit(lambda: messages.keep_view(self.document, message)),
            "remove_view": lambda _, message: self._edit(
                lambda: messages.remove_view(self.document, message)
            ),
            "pick": self._pick,
            "measure": self._measure,
            "tune": self._tune,
            "stop": self._stop_fit,
            "save": lambda client, message: self._files.save(
                message.get("what"), message.get("path"), self._camera(client), _teller(client)
            ),
            "load": lambda client, message: self._files.load(message.get("path"), _teller(client)),
        }

    def connect(self, client: Client) -> None:
        """A browser has come: it is told everything."""
        self.clients[client.id] = client
        if self.card is not None:
            client.post(self._scene_text(self.card))
            client.post(self._state_text())

    def disconnect(self, client: Client) -> None:
        """A browser has gone."""
        self.clients.pop(client.id, None)
        self._queue.drop(client.id)
        self._references.drop(client.id)

    def receive(self, client: Client, text: str | bytes) -> None:
        """A message has come. What is wrong with it is said to its sender, in one line."""
        try:
            message = messages.parsed(text)
            handler = self._handlers.get(message["type"])
            if handler is None:
                raise InputError(f"message: there is no type {message['type']!r:.60}")
            handler(client, message)
        except Exception as error:
            # Nothing that one page says may end the window of another.
            _teller(client)(wire.explained(error))
        self._queue.next(self.clients.values())

    def notify(self, text: str, level: str = "info") -> None:
        """Say a line on every page; an error also to whoever started the window."""
        self._broadcast(wire.as_text(wire.notice(text, level)))
        if level == "error":
            self._tell(text)

    def close(self) -> None:
        """End all processes, and keep what was not saved."""
        self._files.close()
        self._crew.close()
        self._fit.close()
        unfinished_files.ended(self._folder)

    # What browsers say.

    def _look(self, client: Client, message: dict[str, Any]) -> None:
        client.see(messages.parsed_look(message))
        self._want_reference(client)

    def _shown(self, client: Client, message: dict[str, Any]) -> None:
        client.unshown = max(0, client.unshown - 1)

    def _edit(self, edit: Callable[[], None]) -> None:
        edit()
        self._files.edited()
        self._document_changed()

    def _pick(self, client: Client, message: dict[str, Any]) -> None:
        width, height = (1, 1) if client.look is None else client.look.size
        x, y = (min(max(messages.number(message, key), 0.0), 1.0) for key in ("x", "y"))
        seconds = None if message.get("seconds") is None else messages.number(message, "seconds")
        camera = camera_from_json(message.get("camera"), "pick.camera")
        number = messages.whole(message, "id")
        self._queue.ask(PickRequest(client.id, number, x, y, camera, width / height, seconds))

    def _measure(self, client: Client, message: dict[str, Any]) -> None:
        source = message.get("source")
        config = self.document.config(source, self._presets) if isinstance(source, str) else None
        if config is None:
            raise InputError(f"measure.source: there is no config {source!r:.60}")
        if client.look is not None:
            view = self._view(client.look, client.look.size)
            self._queue.ask(MeasureRequest(client.id, str(source), view, config))

    def _tune(self, client: Client, message: dict[str, Any]) -> None:
        _require_tuner("tune")
        now = self.document.now
        camera = camera_from_json(message.get("camera"), "tune.camera")
        lights = tuple(each.light for each in now.lights)
        self._fit.start(FitRequest(self._source, now.config, lights, camera, now.kept, self._fit.folder))

    def _stop_fit(self, client: Client, message: dict[str, Any]) -> None:
        best = self._fit.stop()
        if best is not None:
            self._edit(lambda: self.document.change("take the stopped fit", best))

    # What the processes say.

    def _opened(self, card: SceneCard) -> None:
        first, self.card = self.card is None, card
        if first or not self.document.unsaved_lights:
            self.document.now = replace(self.document.now, lights=card.lights)
            self.document.mark_lights_saved()
        if first:
            for note in card.notes:
                self._tell(note)
            left = self._files.unsaved_of_last_time()
            if left is not None:
                self.document.change("unsaved changes of last time", lambda _: left)
                self._tell("changes of last time that were not saved are back; undo takes them away")
            if not self.opened.done():
                self.opened.set_result(None)
        self._broadcast(self._scene_text(card))
        self._references.restart()
        self._document_changed()

    def _answered(self, answer: Any) -> None:
        self._queue.answered()
        client = None if answer is None else self.clients.get(answer.request.client)
        if answer is None:
            self._refresh()
        elif client is None:
            pass
        elif isinstance(answer, DrawnImage):
            self._send_image(client, answer)
        elif isinstance(answer, Picked):
            client.post(wire.as_text(wire.picked_message(answer)))
        elif isinstance(answer, Measured):
            client.post(wire.as_text(wire.timings_message(answer)))
        elif isinstance(answer, Failed):
            _teller(client)(answer.reason)
        self._queue.next(self.clients.values())

    def _send_image(self, client: Client, drawn: DrawnImage) -> None:
        request = drawn.request
        if not request.settled:
            client.effort = next_effort(client.effort, drawn.milliseconds)
        if self._queue.is_stale(drawn, client):
            return
        share, noise = 1.0, None
        if request.source in messages.OF_REFERENCE:
            _, share, noise = self._references.found(self._reference_request(client))
        client.unshown += 1
        settled = request.settled and share >= 1.0
        client.post(wire.image_message(drawn, settled=settled, share=share, noise=noise))

    def _traced(self, answer: Any) -> None:
        if answer is None or isinstance(answer, Failed):
            self._references.restart()
            if answer is not None:
                self.notify(f"the reference cannot be rendered: {answer.reason}", "error")
        elif isinstance(answer, ReferenceStep) and self._references.step(answer):
            client = self.clients.get(answer.request.client)
            if client is not None:
                client.wanted |= client.panes_of(messages.OF_REFERENCE)
        self._queue.next(self.clients.values())

    def _fit_changed(self, found: TunedConfig | None) -> None:
        if found is not None:
            self.document.tuned = found
            if found.fit is not None and found.fit.status == "improved":
                self._edit(lambda: self.document.change("tune", lambda now: replace(now, config=found)))
                return
            self._refresh()
        self._tell_state()

    # What follows from it.

    def _document_changed(self) -> None:
        self._tell_state()
        for client in self.clients.values():
            self._want_reference(client)
        self._refresh()

    def _refresh(self) -> None:
        for client in self.clients.values():
            client.refresh()
        self._queue.next(self.clients.values())

    def _request(self, client: Client, pane: Pane) -> DrawRequest | None:
        """The request for a pane as it is now; None where there is nothing to draw."""
        look = client.look
        source = client.source_of(pane)
        if look is None or source is None or self.card is None:
            return None
        of_reference = source in messages.OF_REFERENCE
        config = self.document.config(look.error_of if of_reference else source, self._presets)
        if config is None:
            return None
        size = look.size
        if look.moving:
            effort = EFFORTS[client.effort]
            lights = tuple(each.light for each in self.document.now.lights)
            size, config = effort.size(size), effort.config(config, lights, size)
        reference = self._references.found(self._reference_request(client))[0] if of_reference else None
        return DrawRequest(
            client=client.id,
            pane=pane,
            source=source,
            look=look.look,
            view=self._view(look, size),
            follows=self._follows(),
            config=config,
            layer=look.layer,
            seconds=look.seconds,
            settled=not look.moving,
            reference=reference,
        )

    def _view(self, look: Look, size: tuple[int, int]) -> View:
        lights = tuple(each.light for each in self.document.now.lights)
        return View("window", "fitted", size, look.camera, lights)

    def _follows(self) -> tuple[int | None, ...]:
        return tuple(each.follows for each in self.document.now.lights)

    def _reference_request(self, client: Client) -> ReferenceRequest:
        look = client.look
        assert look is not None, "a reference is of a look"
        config = self.document.config(look.error_of, self._presets) or self.document.now.config
        return ReferenceRequest(
            client=client.id,
            view=self._view(look, look.size),
            seconds=look.seconds,
            follows=self._follows(),
            bounces=config.light.most_bounces,
        )

    def _want_reference(self, client: Client) -> None:
        """Have the reference rendered that a page shows, once it rests."""
        look = client.look
        if look is None or look.moving or not client.panes_of(messages.OF_REFERENCE):
            return
        try:
            _require_tuner("reference")
        except MachineError as error:
            _teller(client)(str(error))
            return
        self._references.want(self._reference_request(client))

    def _camera(self, client: Client):
        if client.look is not None:
            return client.look.camera
        if self.card is None:
            raise InputError("save: the scene is not there yet")
        return self.card.camera

    def _scene_text(self, card: SceneCard) -> str:
        path = self._source.path
        tuning = _missing_tuner()
        message = wire.scene_message(card, tuning, self._files.paths)
        return wire.as_text({**message, "path": None if path is None else str(path)})

    def _state_text(self) -> str:
        views = () if self.card is None else self.card.views
        return wire.as_text(wire.state_message(self.document, self._presets, views, self._fit.watch))

    def _tell_state(self) -> None:
        self._broadcast(self._state_text())

    def _broadcast(self, text: str) -> None:
        for client in self.clients.values():
            client.post(text)


def _config(config: str | Path | TunedConfig) -> TunedConfig:
    return config if isinstance(config, TunedConfig) else read_config(config)


def _teller(client: Client) -> Callable[[str], None]:
    """Says errors on the page of one client."""
    return lambda text: client.post(wire.as_text(wire.notice(text, "error")))


@functools.lru_cache(maxsize=1)
def _missing_tuner() -> str | None:
    """Why no fit and no reference can run; None if they can."""
    return f"needs vpltune[tuner]: {how_to_install('tuner')}" if missing_modules("tuner") else None


def _require_tuner(what: str) -> None:
    if (reason := _missing_tuner()) is not None:
        raise MachineError(f"{what}: {reason}")
