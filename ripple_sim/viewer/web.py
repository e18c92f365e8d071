"""The viewer in a browser on the same machine: trame sends frames of an off-screen window, and events come back."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import socket
import sys
import time
from typing import Any

from ripple_sim.errors import DisplayError

from .controls import CONTROLS
from .window import Window

# Without an answer for this long [s] the browser may have been closed, or reopened.
_PATIENCE = 1.0
_QUALITY = 85  # of the JPEG frames, per cent

_STYLE = """
body { margin: 0; font: 14px sans-serif; background: #bdc4cf; color: #111; }
main { outline: none; margin: 12px auto; }
nav { display: flex; flex-wrap: wrap; gap: 6px; margin-bottom: 8px; }
button { font: inherit; padding: 4px 10px; border: 1px solid #667; border-radius: 4px; background: #eef0f3; }
button:hover { background: #fff; }
output { display: block; margin-top: 8px; white-space: pre; }
"""


def check_web(port: int, host: str) -> None:
    """Make sure that the page can be served.

    Raises
    ------
    DisplayError
        If trame is not installed, the port is not free, or the host is not of this machine.
    """
    missing = [name for name in ("trame", "trame_vtk") if importlib.util.find_spec(name) is None]
    if missing:
        raise DisplayError(
            f"--web needs {' and '.join(missing)}, which is not installed; install it with: "
            "pip install 'ripple-sim[web]'"
        )
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        with socket.socket(found[0][0]) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(found[0][4])
    except (OSError, OverflowError, UnicodeError) as error:
        raise DisplayError(
            f"cannot serve on port {port} of {host}: {error}; name another one with --port, or one of this machine's "
            "addresses with --host"
        ) from error


def serve(window: Window, port: int, host: str) -> None:
    """Serve an off-screen window until it is closed or the program is interrupted.

    Parameters
    ----------
    window : Window
    port : int
    host : str
        Name or address to listen at.
    """
    from trame.app import get_server

    from .access import address, exposure, is_local, new_secret, restrict

    server, secret = get_server("ripple-sim"), new_secret()
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
        shown = f"shows {window.plotter.title}, which starts when the page is opened; press Ctrl+C to stop"
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

        self._server, self._window = server, window
        window.hide_texts()
        # numbers of the latest frames sent, and acknowledged by the browser
        self._sent = self._received = 0
        self._heard = 0.0
        server.state.update({"status": "", "sent": 0, "trame__title": f"{window.plotter.title} - ripple-sim"})
        self._opened = asyncio.Event()
        server.controller.on_client_connected.add(self._opened.set)
        width, height = window.plotter.window_size
        with DivLayout(server) as layout:
            layout.root.style = ""
            client.Style(_STYLE)
            client.ClientStateChange(value="sent", change=(self._acknowledge, "[sent]"))
            with html.Main(tabindex=0, style=f"width: {width}px", keydown=(self._key, "[$event.key]")):
                with html.Nav():
                    for control in CONTROLS:
                        if control.action != "help":
                            html.Button(
                                f"{control.label} ({control.key})",
                                id=control.action,
                                click=getattr(window.actions, control.action),
                            )
                with html.Div(id="picture", style=f"height: {height}px"):
                    self._view = vtk.VtkRemoteView(
                        window.plotter.render_window, interactive_ratio=1, interactive_quality=_QUALITY
                    )
                html.Output("{{ status }}", id="status")
        # while an animation runs, this only marks the frame as changed
        window.render = self._view.update

    async def animate(self) -> None:
        """Run the session frame by frame, from when the page is first opened until the window is closed.

        Trame's own animation draws and sends the frames: without one it would draw at every movement of the pointer.
        The next frame is drawn once the browser has the last one, or they would queue up, and clicks with them.
        """
        await self._server.ready
        await self._opened.wait()
        window = self._window
        self._view.start_animation(fps=window.session.fps, quality=_QUALITY)
        frame = 1 / window.session.fps
        due = time.perf_counter()
        while not window.closed:
            now = time.perf_counter()
            if window.tick(draw=self._received == self._sent or now - self._heard > _PATIENCE):
                self._sent, self._heard = self._sent + 1, now
            with self._server.state as state:
                state.update({"status": window.status(), "sent": self._sent})
            due = max(due + frame, time.perf_counter() - frame)
            # at least a moment for the server
            await asyncio.sleep(max(0.001, due - time.perf_counter()))

    def _acknowledge(self, number: int) -> None:
        self._received = number

    def _key(self, name: str) -> None:
        self._window.key("space" if name == " " else name)
