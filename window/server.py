"""Serves a window over HTTP and WebSocket until it is stopped."""

import asyncio
import contextlib
import errno
import itertools
import os
from collections.abc import Callable
from dataclasses import dataclass

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from vpltune.renderer.errors import InputError, MachineError
from vpltune.window.admission import Admission
from vpltune.window.client import Client
from vpltune.window.messages import LARGEST_MESSAGE
from vpltune.window.session import Session, WindowOptions
from vpltune.window.site import Site, refusal

DEFAULT_PORT = 8321
"""A choice: no well-known program listens there."""
MOST_CLIENTS = 16
"""Browsers at a time. A choice: each has images in memory."""


@dataclass(frozen=True)
class ServerOptions:
    """Where a window is served."""

    host: str = "127.0.0.1"
    """Beyond this machine, a page needs the token in the printed address."""
    port: int | None = None
    """None takes `DEFAULT_PORT`, or another one where that is taken."""


async def serve_window(
    window: WindowOptions,
    server: ServerOptions,
    opened: Callable[[str], None],
    tell: Callable[[str], None],
    stop: asyncio.Event | None = None,
    attached: Callable[[Session], None] = lambda session: None,
) -> None:
    """Serve a window until `stop` is set, or the task is cancelled.

    Args:
        window: what to show.
        server: where.
        opened: called with the page's address once it can be opened.
        tell: called with each line for whoever started the window.
        stop: ends the window.
        attached: called with the session once its scene is there.

    Raises:
        InputError: the scene, the config or the port cannot be used.
        MachineError: there is no OpenGL 4.5.
    """
    stop = asyncio.Event() if stop is None else stop
    session = Session(window, tell)
    try:
        await session.opened
        attached(session)
        admission, site = Admission(server.host), Site()
        numbers = itertools.count()

        def requested(connection: ServerConnection, request: Request) -> Response | None:
            if request.path.partition("?")[0] != "/socket":
                return site.response(request.path)
            headers = request.headers
            reason = admission.refusal(request.path, headers.get_all("Host"), headers.get_all("Origin"))
            if reason is None and len(session.clients) >= MOST_CLIENTS:
                reason = f"{MOST_CLIENTS} pages are open already"
            return None if reason is None else refusal(reason)

        async def connected(connection: ServerConnection) -> None:
            await _talk(session, Client(next(numbers)), connection)

        async with await _listening(server, connected, requested) as listener:
            port = listener.sockets[0].getsockname()[1]
            opened(_address(server.host, port, admission.token))
            await stop.wait()
    finally:
        session.close()


async def _listening(server: ServerOptions, connected: Callable, requested: Callable) -> Server:
    """The listening server, on the port that was asked for, or on the usual one, or on any."""
    ports = [server.port] if server.port is not None else [DEFAULT_PORT, 0]
    for port in ports:
        try:
            return await serve(
                connected,
                server.host,
                port,
                process_request=requested,
                max_size=LARGEST_MESSAGE,
                # Images are compressed already.
                compression=None,
                server_header=None,
            )
        except OSError as error:
            if error.errno == errno.EADDRINUSE and port != ports[-1]:
                continue
            where = f"--host {server.host} --port {port}"
            # asyncio's own text repeats address and port.
            known = error.errno is not None and error.errno in errno.errorcode
            reason = os.strerror(error.errno or 0) if known else error.strerror
            if error.errno in (errno.EADDRINUSE, errno.EACCES):
                raise InputError(f"{where}: cannot be listened on ({reason})") from error
            raise InputError(f"{where}: not an address of this machine ({reason})") from error
    raise MachineError("there is no free port")


async def _talk(session: Session, client: Client, connection: ServerConnection) -> None:
    """Exchange messages with one browser until it goes."""
    sending = asyncio.get_running_loop().create_task(_send(client, connection))
    session.connect(client)
    try:
        async for message in connection:
            session.receive(client, message)
    except ConnectionClosed:
        pass
    finally:
        session.disconnect(client)
        sending.cancel()


async def _send(client: Client, connection: ServerConnection) -> None:
    """Send what is posted, as fast as the browser takes it."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            await connection.send(await client.posted())


def _address(host: str, port: int, token: str | None) -> str:
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/" + ("" if token is None else f"?token={token}")
