"""What the tuning process and its parent say to each other: one JSON object a message."""

import json
from multiprocessing.connection import Connection
from typing import Any


def send(connection: Connection, message: dict[str, Any]) -> None:
    connection.send_bytes(json.dumps(message).encode())


def receive(connection: Connection) -> dict[str, Any]:
    """The next message; waits for it.

    Raises:
        EOFError, OSError: the other side is gone.
    """
    return json.loads(connection.recv_bytes())
