"""Messages between the tuning process and its parent, one JSON object each."""

import json
from multiprocessing.connection import Connection
from typing import Any


def send(connection: Connection, message: dict[str, Any]) -> None:
    """Send `message`.

    Raises:
        OSError: the other end is closed.
    """
    connection.send_bytes(json.dumps(message).encode())


def receive(connection: Connection) -> dict[str, Any]:
    """Wait for the next message and return it.

    Raises:
        EOFError, OSError: the other end is closed.
    """
    return json.loads(connection.recv_bytes())
