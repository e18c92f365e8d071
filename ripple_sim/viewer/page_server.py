"""Serving `Pages`: the page over HTTP, and its frames and commands over a websocket."""

from __future__ import annotations

import contextlib
import sys
import threading
import webbrowser
from collections.abc import Iterator
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import Server, ServerConnection, serve as listen

from .access import (
    LARGEST_MESSAGE,
    address,
    exposure,
    is_local,
    new_secret,
    query,
    refusal,
)
from .opening import display_problem
from .page_stream import PageStream
from .page_view import PageView
from .pages import Pages

_SOCKET = "/socket"
_HTML = "text/html; charset=utf-8"


class PageServer:
    """Answers browsers.

    Parameters
    ----------
    pages : Pages
    port : int
        0: a free one.
    host : str
        Name or address to listen at; 127.0.0.1 is reached from this machine alone.

    framed_by : str
        Sites that may show the page within theirs, as in "Content-Security-Policy".

    Attributes
    ----------
    address : str
        What to open in a browser.
    """

    def __init__(self, pages: Pages, port: int, host: str, framed_by: str = "'none'") -> None:
        self._pages = pages
        self._host = host
        self._framed_by = framed_by
        self._secret = new_secret()
        self._server: Server = listen(
            self._stay, host, port, process_request=self._answer, max_size=LARGEST_MESSAGE
        )
        listening = self._server.socket.getsockname()[1]
        self.address = address(host, listening, self._secret)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """End all connections."""
        self._server.shutdown()
        self._thread.join()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The page, a refusal, or None for a websocket."""
        path = urlsplit(request.path).path
        if path == "/favicon.ico":  # browsers ask for it, without the secret
            return connection.respond(204, "")
        refused = refusal(request.path, request.headers, self._host, self._secret)
        if refused is not None:
            status, reason = refused
            return connection.respond(status, reason)
        if path == _SOCKET:
            return None
        if path != "/":
            return connection.respond(404, "there is only /\n")
        response = connection.respond(200, self._pages.open().text)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = _HTML
        response.headers["Content-Security-Policy"] = f"frame-ancestors {self._framed_by}"
        response.headers["Referrer-Policy"] = "no-referrer"
        return response

    def _stay(self, connection: ServerConnection) -> None:
        """Exchange messages with a page until it is closed."""
        number = query(connection.request.path, "page") if connection.request else ""
        stream = self._pages.connect(number)
        if stream is None:
            connection.close(4000, "open the page anew")
            return
        sender = threading.Thread(target=_send, args=(connection, stream), daemon=True)
        sender.start()
        try:
            for message in connection:
                self._pages.ask(stream, message)
        except ConnectionClosed:
            pass
        finally:
            self._pages.leave(stream)


def _send(connection: ServerConnection, stream: PageStream) -> None:
    """Send a page its messages, until there is None in their place."""
    with contextlib.suppress(ConnectionClosed):
        message = stream.messages.get()
        while message is not None:
            connection.send(message)
            message = stream.messages.get()
        connection.close()


@contextlib.contextmanager
def served(pages: Pages, port: int, host: str) -> Iterator[PageServer]:
    """Serve pages while the block runs."""
    server = PageServer(pages, port, host)
    server.start()
    try:
        yield server
    finally:
        server.stop()


def show(view: PageView, port: int, host: str) -> None:
    """Serve a view, and open it in a browser where there is a screen, until it is closed."""
    name = view.session.simulation.scene.name
    if not is_local(host):
        print(exposure(host, view.folder), file=sys.stderr)
    with served(view.pages, port, host) as server:
        print(f"{server.address} shows {name}; press Ctrl+C to stop", flush=True)
        if is_local(host) and display_problem() is None:
            webbrowser.open(server.address)
        with contextlib.suppress(KeyboardInterrupt):  # the usual way to stop
            view.run()
        view.close()
