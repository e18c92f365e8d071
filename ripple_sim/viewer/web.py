"""The viewer in a browser: trame sends the frames of an off-screen window.

Events come back from the page.

Who has the address of this run may use the viewer's page, and only from the page itself. Any page
that is open in the user's browser can send requests to a port of this machine. So the address holds
a secret that is new in every run, and requests are refused whose headers name another site:
`Origin`, the page that asks, and `Host`, the name that the browser looked up, which another site's
name server can point at this machine.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import importlib.util
import ipaddress
import secrets
import socket
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

from ripple_sim.errors import DisplayError

from .controls import CONTROLS
from .window import Window

# [bytes]: largest message from the browser, which sends keys and movements of the pointer
LARGEST_MESSAGE = 64 * 1024

_HEADERS = {"Content-Security-Policy": "frame-ancestors 'none'", "Referrer-Policy": "no-referrer"}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

# [s]: without an answer for this long, the browser may have been closed or reopened
_BROWSER_TIMEOUT = 1.0

# quality of the JPEG frames [per cent]
_JPEG_QUALITY = 85

_STYLE = """
body { margin: 0; font: 14px sans-serif; background: #bdc4cf; color: #111; }
main { outline: none; margin: 0 auto; padding: 12px 0; box-sizing: border-box; height: 100vh;
  display: flex; flex-direction: column; }
#picture { flex: 0 1 auto; min-height: 0; }
nav { display: flex; flex-wrap: wrap; gap: 6px; margin-bottom: 8px; }
button { font: inherit; padding: 4px 10px; border: 1px solid #667; border-radius: 4px;
  background: #eef0f3; }
button:hover { background: #fff; }
output { display: block; margin-top: 8px; white-space: pre; }
"""


def new_secret() -> str:
    """128 random bits; a letter comes first, since the page takes digits for a number."""
    return f"s{secrets.token_hex(16)}"


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


def restrict(server: Any, *, host: str, port: int, secret: str) -> None:
    """Have a trame server listen at an address, and answer only those who have the secret.

    Parameters
    ----------
    server : trame_server.Server
        Not started yet.
    host : str
        Name or address to listen at; 127.0.0.1 is reached from this machine alone.
    port : int
    secret : str
        From `new_secret`.
    """
    server.options["ws_max_msg_size"] = LARGEST_MESSAGE
    for name, value in _HEADERS.items():
        server.http_headers.set_header(name, value)
    words = [
        "--host",
        host,
        "--port",
        str(port),
        "--authKey",
        secret,
        "--timeout",
        "0",
        "--nosignalhandlers",
    ]
    options: tuple[argparse.Namespace, list[str]] = server.cli.parse_known_args(
        [*words, "--no-ws-compress"]
    )
    # trame would read this program's own command line
    server.cli.parse_known_args = lambda: options
    server.controller.on_server_bind.add(lambda served: served.app.middlewares.append(guard(host)))


def guard(host: str) -> Callable[[web.Request, Handler], Awaitable[web.StreamResponse]]:
    """Make the middleware that refuses requests from other sites.

    The server listens at `host`.
    """

    @web.middleware
    async def refuse_strangers(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not _is_own(request.host, host):
            raise web.HTTPForbidden(
                text=f"Host is {request.host[:80]!r}, which is not a name of this server\n"
            )
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.host:
            raise web.HTTPForbidden(
                text=f"Origin is {origin[:80]!r}: this page answers only itself\n"
            )
        return await handler(request)

    return refuse_strangers


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


def check_web(port: int, host: str) -> None:
    """Make sure that the page can be served.

    Raises
    ------
    DisplayError
        If trame is not installed, the port is not free, or the host is not of this machine.
    """
    if missing := [
        name for name in ("trame", "trame_vtk") if importlib.util.find_spec(name) is None
    ]:
        raise DisplayError(
            f"--web needs {' and '.join(missing)}, which is not installed; install it with: pip "
            "install 'ripple-sim[web]'"
        )
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        with socket.socket(found[0][0]) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(found[0][4])
    except (OSError, OverflowError, UnicodeError) as error:
        raise DisplayError(
            f"cannot serve on port {port} of {host}: {error}; name another one with --port, or "
            "one of this machine's addresses with --host"
        ) from error


def serve(window: Window, port: int, host: str) -> None:
    """Serve an off-screen window at a host name or address.

    It returns when the window is closed or the program is interrupted.
    """
    from trame.app import get_server

    server = get_server("ripple-sim")
    secret = new_secret()
    restrict(server, host=host, port=port, secret=secret)
    window.open()
    page = _Page(server, window)
    if not is_local(host):
        print(exposure(host, window.recorder.folder), file=sys.stderr)

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(_report)
        serving = asyncio.ensure_future(
            server.start(exec_mode="coroutine", open_browser=False, show_connection_info=False)
        )
        shown = (
            f"shows {window.plotter.title}, which starts when the page is opened; press Ctrl+C to "
            "stop"
        )
        print(f"{address(host, port, secret)} {shown}", flush=True)
        await page.animate()
        await server.stop()
        with contextlib.suppress(asyncio.CancelledError):
            await serving

    try:
        asyncio.run(main())
    except KeyboardInterrupt:  # the usual way to stop
        pass
    finally:
        window.close()


def _report(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Ignore a browser that has left while something was being sent to it."""
    if not isinstance(context.get("exception"), ConnectionError):
        loop.default_exception_handler(context)


class _Page:
    """The page's elements, and the loop that keeps them up to date."""

    def __init__(self, server: Any, window: Window) -> None:
        from trame.ui.html import DivLayout
        from trame.widgets import client, html, vtk

        self._server = server
        self._window = window
        window.hide_texts()
        # numbers of the latest frames sent, and acknowledged by the browser
        self._sent = 0
        self._received = 0
        self._heard = 0.0
        server.state.update(
            {"status": "", "sent": 0, "trame__title": f"{window.plotter.title} - ripple-sim"}
        )
        self._opened = asyncio.Event()
        server.controller.on_client_connected.add(self._opened.set)
        width, height = window.plotter.window_size
        with DivLayout(server) as layout:
            layout.root.style = ""
            client.Style(_STYLE)
            client.ClientStateChange(value="sent", change=(self._acknowledge, "[sent]"))
            with html.Main(
                tabindex=0, style=f"max-width: {width}px", keydown=(self._key, "[$event.key]")
            ):
                with html.Nav():
                    for key, action, label in CONTROLS:
                        if action != "help":
                            html.Button(
                                f"{label} ({key})", id=action, click=getattr(window, action)
                            )
                with html.Div(id="picture", style=f"height: {height}px"):
                    self._view = vtk.VtkRemoteView(
                        window.plotter.render_window,
                        interactive_ratio=1,
                        interactive_quality=_JPEG_QUALITY,
                    )
                html.Output("{{ status }}", id="status")
        # while an animation runs, this only marks the frame as changed
        window.render = self._view.update

    async def animate(self) -> None:
        """Run the session frame by frame, from the first opening of the page until the end.

        Trame's own animation draws and sends the frames: without one it would draw at every
        movement of the pointer. The next frame is drawn once the browser has the last one, or they
        would queue up, and clicks with them.
        """
        await self._server.ready
        await self._opened.wait()
        window = self._window
        self._view.start_animation(fps=window.session.fps, quality=_JPEG_QUALITY)
        frame = 1 / window.session.fps
        due = time.perf_counter()
        while not window.closed:
            now = time.perf_counter()
            if window.tick(
                draw=self._received == self._sent or now - self._heard > _BROWSER_TIMEOUT
            ):
                self._sent = self._sent + 1
                self._heard = now
            with self._server.state as state:
                state.update({"status": window.status(), "sent": self._sent})
            due = max(due + frame, time.perf_counter() - frame)
            # at least a moment for the server
            await asyncio.sleep(max(0.001, due - time.perf_counter()))

    def _acknowledge(self, number: int) -> None:
        self._received = number

    def _key(self, name: str) -> None:
        self._window.key("space" if name == " " else name)
