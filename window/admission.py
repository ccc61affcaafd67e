"""Who may talk to the window: pages of its own, on this machine, or with its token from elsewhere."""

import hmac
import ipaddress
import secrets
from urllib.parse import parse_qs, urlsplit

TOKEN_BYTES = 16
"""Random bytes of a token: 128 bits cannot be guessed."""


class Admission:
    """The rules for one address of the server.

    Args:
        host: the address that the server listens on.
    """

    def __init__(self, host: str):
        self._local = is_loopback(host)
        self.token = None if self._local else secrets.token_urlsafe(TOKEN_BYTES)
        """What a page from another machine must know; None where only this machine can connect."""

    def refusal(self, path: str, hosts: list[str], origins: list[str]) -> str | None:
        """Why a request for the socket is refused; None if it may come in.

        A web page of somebody else, open in the same browser, can connect to this machine too. It cannot
        forge the header Origin, nor, on a name of its own that it points here, the header Host.

        Args:
            path: with the query, which may hold the token.
            hosts: values of the header Host.
            origins: values of the header Origin; programs that are no browsers send none.
        """
        if len(hosts) != 1 or len(origins) > 1:
            return "the headers Host and Origin must be there once"
        host, origin = hosts[0], origins[0] if origins else None
        if origin is not None and urlsplit(origin).netloc != host:
            return "the page is from another site"
        if self._local and not is_loopback(_name_of(host)):
            return "the name is not this machine's"
        if self.token is not None:
            given = parse_qs(urlsplit(path).query).get("token", [""])[0]
            if not hmac.compare_digest(given.encode(), self.token.encode()):
                return "the token is missing or wrong; use the address that the program printed"
        return None


def is_loopback(host: str) -> bool:
    """Whether a host name or address is this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def _name_of(netloc: str) -> str:
    """The host of `host:port`, `[::1]:port` or `host`."""
    return urlsplit(f"//{netloc}").hostname or ""
