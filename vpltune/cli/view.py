"""`vpltune view`: a window in the browser in which a scene is looked at, edited and tuned."""

from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.options import SceneArgument
from vpltune.cli.report import INTERRUPTED, Report, warn
from vpltune.renderer.errors import InputError

LOWEST_PORT = 1024
"""Ports below belong to the system."""


def view(
    scene: SceneArgument,
    config: Annotated[
        str, typer.Option(metavar="FILE", help="A tuned config to begin with, `default` or `auto`.")
    ] = "default",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder that Save writes tuned.json to. [that of --config, or out/SCENE]",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(metavar="P", min=LOWEST_PORT, max=65535, help="Port to serve on. [8321, or a free one]"),
    ] = None,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to serve on; beyond this machine, the page needs the token that is printed.",
        ),
    ] = "127.0.0.1",
    open_page: Annotated[bool, typer.Option("--open", help="Open the page in the system's browser.")] = False,
) -> Report:
    """Open a window in the browser: look around, edit lights and parameters, tune, compare and save."""
    import asyncio

    from vpltune.guard import asked_to_stop
    from vpltune.window.requests import SceneSource
    from vpltune.window.server import ServerOptions, serve_window
    from vpltune.window.session import WindowOptions

    if not scene.is_file():
        raise InputError(f"{scene}: cannot be read (no such file)")
    window = WindowOptions(SceneSource(scene), config, output)

    def opened(address: str) -> None:
        print(address, flush=True)
        if open_page:
            import webbrowser

            webbrowser.open(address)

    async def serve() -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None, "asyncio runs this as a task"

        # Raised in the midst of some other task, KeyboardInterrupt would be that one's failure.
        def end() -> None:
            loop.call_soon_threadsafe(task.cancel)

        with asked_to_stop(end):
            await serve_window(window, ServerOptions(host, port), opened, lambda line: warn((line,)))

    try:
        asyncio.run(serve())
    except (asyncio.CancelledError, KeyboardInterrupt):
        # The guard says which signal it was.
        raise SystemExit(INTERRUPTED) from None
    return Report({"status": "ok"}, ())
