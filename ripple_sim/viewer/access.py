"""Who may use the viewer's page: those who have the address of this run, from the page itself.

Any page that is open in the user's browser can send requests to a port of this machine. So the
address holds a secret that is new in every run, and requests are refused whose headers name another
site: `Origin`, the page that asks, and `Host`, the name that the browser looked up, which another
site's name server can point at this machine.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from ripple_sim.errors import DisplayError

# [bytes]: largest message from the browser, which sends commands and places of the pointer
LARGEST_MESSAGE = 64 * 1024

# of TCP
_MAX_PORT = 65535


def new_secret() -> str:
    """128 random bits."""
    return secrets.token_hex(16)


def is_local(host: str) -> bool:
    """Whether a server at a host can be reached from this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def address(host: str, port: int, secret: str) -> str:
    """The address to open in a browser."""
    name = host
    if host in ("0.0.0.0", "::"):
        name = socket.gethostname()
    elif ":" in host:  # IPv6
        name = f"[{host}]"
    return f"http://{name}:{port}/?secret={secret}"


def exposure(host: str, folder: Path) -> str:
    """A warning in one line for a host that is not local: what others can reach."""
    return (
        f"ripple-sim: --host {host} lets other machines connect: whoever has the address sees and "
        f"drives this scene, and writes screenshots and videos to {folder.absolute()}; nothing is "
        "encrypted, so the address can be read on its way"
    )


def refusal(
    path: str, headers: Mapping[str, str], host: str, secret: str
) -> tuple[int, str] | None:
    """Status and reason why a request is refused; None if it is answered.

    Parameters
    ----------
    path : str
        With its query.
    headers : mapping
        Of the request.
    host : str
        What the server listens at.
    secret : str
        From `new_secret`.
    """
    named = headers.get("Host", "")
    if not _is_own(named, host):
        return 403, f"Host is {named[:80]!r}, which is not a name of this server\n"
    origin = headers.get("Origin")
    if origin is not None and urlsplit(origin).netloc != named:
        return 403, f"Origin is {origin[:80]!r}: this page answers only itself\n"
    if not hmac.compare_digest(query(path, "secret").encode(), secret.encode()):
        return 403, "the address has not the secret of this run\n"
    return None


def query(path: str, name: str) -> str:
    """A value of the query of a path, "" without."""
    return parse_qs(urlsplit(path).query).get(name, [""])[0]


def _is_own(netloc: str, host: str) -> bool:
    """Whether a Host header names this server, at any port: a tunnel may lead to it.

    A number is no name that another site's name server could give; where this machine alone is
    served it must be one of the machine's own.
    """
    local = is_local(host)
    try:
        name = urlsplit(f"//{netloc}").hostname or ""
        if name == "localhost" or (
            not local and name in (host.lower(), socket.gethostname().lower())
        ):
            return True
        number = ipaddress.ip_address(name)
    except ValueError:
        return False
    return number.is_loopback or not local


def check_port(port: int, host: str) -> None:
    """Make sure that the page can be served.

    Raises
    ------
    DisplayError
        If the port is no port or not free, or the host is not of this machine.
    """
    if not 0 <= port <= _MAX_PORT:
        raise DisplayError(f"port must be a whole number from 0 to {_MAX_PORT}, got {port}")
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        family, _, _, _, address = addresses[0]
        with socket.socket(family) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
    except (OSError, OverflowError, UnicodeError) as error:
        raise DisplayError(
            f"cannot serve on port {port} of {host}: {error}; name another one with --port, or "
            "one of this machine's addresses with --host"
        ) from error
