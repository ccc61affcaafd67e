"""Saves, loads and watches the files of a window, and keeps what was not saved."""

import asyncio
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import PRESETS, TunedConfig, read_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.placement.sidecar_file import sidecar_path
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.views import light_to_json
from vpltune.window import saving, wire
from vpltune.window.document import Document, Edited
from vpltune.window.recovery import Recovery
from vpltune.window.watched_files import WatchedFiles

SECONDS_BETWEEN_LOOKS = 1.0
"""Between two looks at the files on disk, and before unsaved changes are written down. A choice."""


class FileDesk:
    """The files of one window. What waits for the disk waits in a thread.

    Args:
        document: what is saved, and what loaded configs change.
        scene: the scene's file; None for a scene in memory.
        config: the config file that the window was opened with; None for a preset.
        output: the folder to save to; None takes the usual one.
        fit_result: gives the config and the folder of the fit whose result a config is, or None.
        scene_changed: called when the scene or its sidecar should be read anew.
        changed: called when the document has changed or was saved.
        notify: called with a line and its level.
    """

    def __init__(
        self,
        document: Document,
        scene: Path | None,
        config: Path | None,
        output: Path | None,
        *,
        fit_result: Callable[[TunedConfig], tuple[TunedConfig, Path] | None],
        scene_changed: Callable[[], None],
        changed: Callable[[], None],
        notify: Callable[..., None],
    ):
        self._document, self._scene, self._config = document, scene, config
        self._fit_result, self._scene_changed, self._changed = fit_result, scene_changed, changed
        self._notify = notify
        self.paths = saving.usual_paths(scene, config, output)
        """Where the config, the sidecar and the views are saved if nobody says otherwise."""
        self._recovery = Recovery(scene)
        self._edited_at: float | None = None
        self._watched = WatchedFiles()
        for path in (scene, config, None if scene is None else sidecar_path(scene)):
            if path is not None:
                self._watched.watch(path)
        loop = asyncio.get_running_loop()
        self._tasks = {loop.create_task(self._watch())}

    def close(self) -> None:
        """Stop watching, and write down what was not saved."""
        for task in self._tasks:
            task.cancel()
        if self._edited_at is not None:
            self._recovery.keep(self._document.now)

    def edited(self) -> None:
        """The document has been edited: it will be written down soon."""
        self._edited_at = time.monotonic()

    def save(self, what: Any, path: Any, camera: Camera, tell_sender: Callable[[str], None]) -> None:
        """Save `config`, `sidecar` or `views`; what goes wrong is told to the sender.

        Raises:
            InputError: there is nothing of that name, or the path is no path.
        """
        if not isinstance(what, str) or what not in self.paths:
            raise InputError(f"save.what: must be one of {', '.join(self.paths)}, got {what!r:.60}")
        target = self.paths[what] if path is None else _path(path, "save.path")
        self._start(self._saved(what, target, camera), tell_sender)

    def load(self, path: Any, tell_sender: Callable[[str], None]) -> None:
        """Read a config, which becomes the tuned one and the one by hand.

        Raises:
            InputError: the path is no path.
        """
        self._start(self._loaded(_path(path, "load.path")), tell_sender)

    def unsaved_of_last_time(self) -> Edited | None:
        """The changes that the last window of this scene did not save; None if there are none."""
        now = self._document.now
        left = self._recovery.left(now)
        if left is None:
            return None
        before, after = ([light_to_json(each.light) for each in state.lights] for state in (now, left))
        if left.config.draws_as(now.config) and before == after and not left.kept:
            self._recovery.forget()
            return None
        return left if before != after else replace(left, lights=now.lights)

    async def _saved(self, what: str, path: Path, camera: Camera) -> None:
        now = self._document.now
        name = "" if self._scene is None else str(self._scene)
        if what == "config":
            by_hand = now.config.provenance or {"scene": name, "edited": "by hand in vpltune view"}
            result = self._fit_result(now.config) or (replace(now.config, provenance=by_hand), None)
            line = await asyncio.to_thread(saving.save_config, path, *result)
        elif what == "sidecar":
            line = await asyncio.to_thread(saving.save_sidecar, path, camera, now.lights)
        else:
            line = await asyncio.to_thread(saving.save_views, path, name, camera, now)
        if path in (self._config, self.paths["sidecar"]):
            self._watched.watch(path)
        # Only if nothing was changed while the disk was at work.
        if what == "config" and self._document.now.config is now.config:
            self._document.mark_saved()
        if what == "sidecar" and self._document.now.lights is now.lights:
            self._document.mark_lights_saved()
        if what == "views" and self._document.now.kept is now.kept:
            self._document.mark_views_saved()
        if self._document.all_saved:
            self._edited_at = None
            await asyncio.to_thread(self._recovery.forget)
        self._notify(line)
        self._changed()

    async def _loaded(self, path: Path) -> None:
        config = await asyncio.to_thread(read_config, path)
        self._take(path, config)
        self._notify(f"read {path}")

    def _take(self, path: Path, config: TunedConfig) -> None:
        self._document.change(f"read {path.name}", lambda now: replace(now, config=config))
        self._document.tuned = config
        self._document.mark_saved()
        self._changed()

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(SECONDS_BETWEEN_LOOKS)
            await self._write_down()
            for path, change in self._watched.changes():
                if change == "gone":
                    self._notify(f"{path} has gone; the window goes on with what it has read", "error")
                elif path == self._config:
                    await self._config_changed(path)
                else:
                    self._notify(f"{path} has changed and is read again")
                    self._scene_changed()

    async def _write_down(self) -> None:
        edited = self._edited_at
        if edited is None or time.monotonic() - edited < SECONDS_BETWEEN_LOOKS:
            return
        self._edited_at = None
        if self._document.all_saved:
            await asyncio.to_thread(self._recovery.forget)
        else:
            await asyncio.to_thread(self._recovery.keep, self._document.now)

    async def _config_changed(self, path: Path) -> None:
        try:
            config = await asyncio.to_thread(read_config, path)
        except InputError as error:
            self._notify(f"the config stays as it was: {error}", "error")
            return
        self._notify(f"{path} has changed and was read again")
        if self._document.unsaved:
            self._document.tuned = config
            self._changed()
        else:
            self._take(path, config)

    def _start(self, work: Any, tell_sender: Callable[[str], None]) -> None:
        async def done() -> None:
            try:
                await work
            except Exception as error:
                tell_sender(wire.explained(error))

        task = asyncio.get_running_loop().create_task(done())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def config_file(config: str | Path | TunedConfig) -> Path | None:
    """The file that a config comes from; None for a preset or a config in memory."""
    if isinstance(config, TunedConfig) or str(config) in PRESETS:
        return None
    return Path(config)


def _path(value: Any, where: str) -> Path:
    if not isinstance(value, str) or not value.strip() or "\0" in value:
        raise InputError(f"{where}: must be a path, got {value!r:.60}")
    try:
        os.fsencode(value)
    except UnicodeEncodeError as error:
        raise InputError(f"{where}: is not a name that a file can have, got {value!r:.60}") from error
    return Path(value.strip()).expanduser()
