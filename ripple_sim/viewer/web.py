"""The viewer in a browser on the same machine: trame sends pictures of an off-screen window, and events come back."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import socket
import time
from typing import Any

from ..errors import DisplayError
from .controls import CONTROLS
from .window import Window

HOST = "127.0.0.1"

_STYLE = """
body { margin: 0; font: 14px sans-serif; background: #bdc4cf; color: #111; }
main { outline: none; width: max-content; margin: 12px auto; }
nav { display: flex; flex-wrap: wrap; gap: 6px; margin-bottom: 8px; }
button { font: inherit; padding: 4px 10px; border: 1px solid #667; border-radius: 4px; background: #eef0f3; }
button:hover { background: #fff; }
output { display: block; margin-top: 8px; white-space: pre; }
"""


def check_web(port: int) -> None:
    """Make sure that the page can be served.

    Raises
    ------
    DisplayError
        If trame is not installed, or the port is not free.
    """
    missing = [name for name in ("trame", "trame_vtk") if importlib.util.find_spec(name) is None]
    if missing:
        raise DisplayError(
            f"--web needs {' and '.join(missing)}, which is not installed; install it with: pip install 'ripple-sim[web]'"
        )
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((HOST, port))
        except (OSError, OverflowError) as error:
            raise DisplayError(
                f"cannot serve on port {port} of {HOST}: {error}; name another one with --port"
            ) from error


def serve(window: Window, port: int) -> None:
    """Serve a window that was made off screen, until it is closed or the program is interrupted."""
    from trame.app import get_server

    server = get_server("ripple-sim")
    server.cli.set_defaults()
    window.open()
    page = _Page(server, window)

    async def main() -> None:
        serving = asyncio.ensure_future(
            server.start(
                port=port, host=HOST, exec_mode="coroutine", open_browser=False, show_connection_info=False, timeout=0
            )
        )
        print(f"http://{HOST}:{port}/ shows {window.plotter.title}; end it with Ctrl+C", flush=True)
        await page.animate()
        await server.stop()
        with contextlib.suppress(asyncio.CancelledError):
            await serving

    try:
        asyncio.run(main())
    finally:
        window.close()


class _Page:
    """The page's elements, and the loop that keeps them up to date."""

    def __init__(self, server: Any, window: Window) -> None:
        from trame.ui.html import DivLayout
        from trame.widgets import client, html, vtk

        self._server, self._window = server, window
        window.hide_texts()
        server.state.status = ""
        width, height = window.plotter.window_size
        with DivLayout(server) as layout:
            layout.root.style = ""
            client.Style(_STYLE)
            with html.Main(tabindex=0, keydown=(self._key, "[$event.key]")):
                with html.Nav():
                    for control in CONTROLS:
                        if control.action != "help":
                            html.Button(
                                f"{control.label} ({control.key})",
                                id=control.action,
                                click=getattr(window, control.action),
                            )
                with html.Div(style=f"width: {width}px; height: {height}px"):
                    self._view = vtk.VtkRemoteView(window.plotter.render_window, interactive_ratio=1, still_quality=85)
                html.Output("{{ status }}", id="status")
        window.render = self._view.update

    async def animate(self) -> None:
        """Go on with the session frame by frame until the window is closed."""
        window = self._window
        frame = 1 / window.session.fps
        due = time.perf_counter()
        while not window.closed:
            window.tick()
            with self._server.state as state:
                state.status = window.status()
            due = max(due + frame, time.perf_counter() - frame)
            # at least a moment for the server
            await asyncio.sleep(max(0.001, due - time.perf_counter()))

    def _key(self, name: str) -> None:
        self._window.key("space" if name == " " else name)
