"""The page's own files, over HTTP."""

from http import HTTPStatus
from importlib.resources import files
from importlib.resources.abc import Traversable

from websockets.datastructures import Headers
from websockets.http11 import Response

TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
"""Media types of the files of a page, by suffix."""
# The page loads nothing from elsewhere. It may stand in a frame: notebooks show it so.
_POLICY = "default-src 'self'; img-src 'self' blob:; object-src 'none'; base-uri 'none'"


class Site:
    """The files of `page/`, read once."""

    def __init__(self) -> None:
        self._files: dict[str, bytes] = {}
        self._read(files("vpltune.window").joinpath("page"), "")

    def _read(self, folder: Traversable, prefix: str) -> None:
        for each in folder.iterdir():
            if each.is_dir():
                self._read(each, f"{prefix}{each.name}/")
            elif _suffix(each.name) in TYPES:
                self._files[prefix + each.name] = each.read_bytes()

    def response(self, path: str) -> Response:
        """The answer to a request for a path; `/` is the page."""
        name = path.partition("?")[0].removeprefix("/") or "index.html"
        if name not in self._files:
            return _response(HTTPStatus.NOT_FOUND, "text/plain", b"there is no such file\n")
        return _response(HTTPStatus.OK, TYPES[_suffix(name)], self._files[name])


def refusal(reason: str) -> Response:
    """The answer to somebody who may not come in."""
    return _response(HTTPStatus.FORBIDDEN, "text/plain", f"refused: {reason}\n".encode())


def _response(status: HTTPStatus, media_type: str, body: bytes) -> Response:
    headers = Headers(
        {
            "Content-Type": f"{media_type}; charset=utf-8",
            "Content-Length": str(len(body)),
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            # The address may hold the token.
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
            "Connection": "close",
        }
    )
    return Response(status.value, status.phrase, headers, body)


def _suffix(name: str) -> str:
    return name[name.rfind(".") :]
