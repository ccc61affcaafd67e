"""`vpltune.view`: opens a window from Python, in a notebook as a frame below the cell."""

import asyncio
import atexit
import html
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.window.requests import SceneSource
from vpltune.window.server import ServerOptions, serve_window
from vpltune.window.session import Session, WindowOptions
from vpltune.window.spawned import spawned

FRAME_HEIGHT = 720
"""Height of the frame in a notebook, in pixels. A choice: a laptop shows it whole."""
LONGEST_ANSWER = 30.0
"""Seconds that a question to the window may take: nothing there takes long, but the machine may be busy."""


class Window:
    """An open window. It closes with `close`, at the end of a `with` block, or with the program.

    Example:
        >>> window = vpltune.view("scene.glb", "out/tuned.json")
        >>> window.config  # as it stands in the page
    """

    def __init__(self, process: Any, connection: Any, address: str):
        self._process, self._connection = process, connection
        self.address = address
        """The address of the page, for a browser."""
        atexit.register(self.close)

    @property
    def config(self) -> TunedConfig:
        """The config by hand, as it stands in the page.

        Raises:
            MachineError: the window is closed.
        """
        return self._asked("config")

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights, as they stand in the page. Raises as `config`."""
        return self._asked("lights")

    def close(self) -> None:
        """Close the window. What was not saved comes back when the same scene file is opened again."""
        atexit.unregister(self.close)
        self._connection.close()
        self._process.join(timeout=LONGEST_ANSWER)
        if self._process.is_alive():
            self._process.kill()

    def __enter__(self) -> "Window":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Window({self.address if self._process.is_alive() else 'closed'})"

    def _repr_html_(self) -> str:
        address = html.escape(self.address, quote=True)
        return (
            f'<iframe src="{address}" width="100%" height="{FRAME_HEIGHT}" style="border: 0"></iframe>'
            f'<p><a href="{address}" target="_blank">{address}</a></p>'
        )

    def _asked(self, question: str) -> Any:
        try:
            self._connection.send(question)
            if self._connection.poll(LONGEST_ANSWER):
                return self._connection.recv()
        except (OSError, EOFError) as error:
            raise MachineError("the window is closed") from error
        raise MachineError("the window does not answer")


def view(
    scene: str | Path | Scene,
    config: str | Path | TunedConfig = "default",
    *,
    camera: Camera | None = None,
    lights: tuple[Light, ...] | None = None,
    output: str | Path | None = None,
    host: str = "127.0.0.1",
    port: int | None = None,
) -> Window:
    """Open a window in which a scene is looked at, edited and tuned; it serves a page to browsers.

    Args:
        scene: a glTF, OBJ or PLY file, or a scene in memory.
        config: where the config by hand begins: a file, "default", "auto", or a config.
        camera: where to begin; None takes that of the scene or its sidecar, or places one.
        lights: None takes those of the scene or its sidecar, or places one.
        output: folder that the page saves to; None is that of the config file, or out/SCENE.
        host: address to serve on; beyond this machine, the page needs the token in `Window.address`.
        port: None takes a free one.

    Raises:
        InputError: the scene, its sidecar, the config or the port cannot be used.
        MachineError: there is no OpenGL 4.5.
    """
    if isinstance(scene, Scene):
        source = SceneSource(scene=scene, camera=camera, lights=lights)
    elif Path(scene).is_file():
        source = SceneSource(Path(scene), camera=camera, lights=lights)
    else:
        raise InputError(f"{scene}: cannot be read (no such file)")
    options = WindowOptions(source, config, None if output is None else Path(output))
    # Not a daemon: it has processes of its own. It ends when the pipe to it is closed.
    process, ours = spawned(_serve, (options, ServerOptions(host, port)), name="window", daemon=False)
    try:
        answer = ours.recv()
    except EOFError as error:
        raise MachineError("the window ended before it was open") from error
    if isinstance(answer, Exception):
        process.join()
        raise answer
    return Window(process, ours, answer)


def _serve(connection: Connection, window: WindowOptions, server: ServerOptions) -> None:
    """The process of a window that was opened from Python."""
    try:
        asyncio.run(_serve_until_closed(connection, window, server))
    except (InputError, MachineError) as error:
        connection.send(error)


async def _serve_until_closed(connection: Connection, window: WindowOptions, server: ServerOptions) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()

    def attached(session: Session) -> None:
        def answer() -> None:
            try:
                question = connection.recv()
                now = session.document.now
                lights = tuple(each.light for each in now.lights)
                connection.send({"config": now.config, "lights": lights}[question])
            except (EOFError, OSError):
                loop.remove_reader(connection.fileno())
                stop.set()

        loop.add_reader(connection.fileno(), answer)

    await serve_window(
        window, server, connection.send, lambda line: print(line, flush=True), stop=stop, attached=attached
    )
