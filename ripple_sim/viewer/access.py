"""Who may use the viewer's page: whoever has the address of this run, and only from the page itself.

Any page that is open in the user's browser can send requests to a port of this machine. So the address holds a secret
that is new in every run, and requests are refused whose headers name another site: `Origin`, the page that asks, and
`Host`, the name that the browser looked up, which another site's name server can point at this machine.
"""

from __future__ import annotations

import argparse
import ipaddress
import secrets
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

LOOPBACK = "127.0.0.1"

# Of a message from the browser [bytes]: it sends keys and movements of the pointer.
LARGEST_MESSAGE = 64 * 1024

_HEADERS = {"Content-Security-Policy": "frame-ancestors 'none'", "Referrer-Policy": "no-referrer"}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def new_secret() -> str:
    """128 random bits; a letter comes first, since the page takes digits for a number."""
    return f"s{secrets.token_hex(16)}"


def is_local(host: str) -> bool:
    """Whether what listens at a host is reached from this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def address(host: str, port: int, secret: str) -> str:
    """What to open in a browser."""
    name = socket.gethostname() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/?secret={secret}"


def exposure(host: str, folder: Path) -> str:
    """What is open to others where a host is not local, in one line."""
    return (
        f"ripple-sim: --host {host} lets other machines connect: whoever has the address sees and drives this scene, "
        f"and writes screenshots and videos to {folder.absolute()}; nothing is encrypted, so the address can be read "
        "on its way"
    )


def restrict(server: Any, *, host: str, port: int, secret: str) -> None:
    """Have a trame server listen at an address, and answer only those who have the secret.

    Parameters
    ----------
    server : trame_server.Server
        Not started yet.
    host : str
        Name or address to listen at; `LOOPBACK` is reached from this machine alone.
    port : int
    secret : str
        From `new_secret`.
    """
    server.options["ws_max_msg_size"] = LARGEST_MESSAGE
    for name, value in _HEADERS.items():
        server.http_headers.set_header(name, value)
    words = ["--host", host, "--port", str(port), "--authKey", secret, "--timeout", "0", "--nosignalhandlers"]
    options: tuple[argparse.Namespace, list[str]] = server.cli.parse_known_args([*words, "--no-ws-compress"])
    server.cli.parse_known_args = lambda: options  # trame would read this program's own command line
    server.controller.on_server_bind.add(lambda served: served.app.middlewares.append(guard(host)))


def guard(host: str) -> Callable[[web.Request, Handler], Awaitable[web.StreamResponse]]:
    """Middleware that refuses requests which other sites can have caused, at a server that listens at `host`."""

    @web.middleware
    async def refuse_strangers(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not _is_own(request.host, host):
            raise web.HTTPForbidden(text=f"Host is {request.host[:80]!r}, which is not a name of this server\n")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.host:
            raise web.HTTPForbidden(text=f"Origin is {origin[:80]!r}: this page answers only itself\n")
        return await handler(request)

    return refuse_strangers


def _is_own(netloc: str, host: str) -> bool:
    """Whether a Host header names this server, at any port: a tunnel may lead to it.

    A number is no name that another site's name server could give; where this machine alone is served it must be one
    of the machine's own.
    """
    try:
        name = urlsplit(f"//{netloc}").hostname or ""
    except ValueError:
        return False
    local = is_local(host)
    if name == "localhost" or (not local and name in (host.lower(), socket.gethostname().lower())):
        return True
    try:
        number = ipaddress.ip_address(name)
    except ValueError:
        return False
    return number.is_loopback or not local
