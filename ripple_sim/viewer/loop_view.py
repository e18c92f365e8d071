"""`view` shows anybody's loop in the browser: `LoopView`."""

from __future__ import annotations

import html
import time
import webbrowser
from collections.abc import Callable
from typing import Any, Self

import mujoco
import numpy as np

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.own_model import own_data, own_model
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError
from ripple_sim.export.exporter import loop_source
from ripple_sim.export.options import MOST_TRIANGLES
from ripple_sim.export.source import Source
from ripple_sim.scene.camera_entry import CameraEntry
from ripple_sim.solver.errors import checked, instance

from .access import check_port
from .hand import Hand
from .opening import display_problem, poke_strength
from .page_server import PageServer
from .pages import Command, Pages, target_of

# Frames a second that the page's clock counts.
_FPS = 60

# Size of the pictures that the camera is meant for [pixels]: a page is as large as its window.
_PICTURE_SIZE = (1280, 720)

# Sites that may show the page within theirs: notebooks on this machine, or through a tunnel.
_NOTEBOOKS = "http://localhost:* http://127.0.0.1:*"

# Pause before a page that is paused or behind is looked at again [s].
_PATIENCE = 0.01

# Height of the page within a notebook [pixels].
_FRAME_HEIGHT = 420


class LoopView:
    """A loop of one's own that a page in the browser shows; `view` makes it.

    Use it as a context manager, and call `sync` after each frame.

    Attributes
    ----------
    address : str
        What to open in a browser.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        ripples: Ripples,
        source: Source,
        port: int,
        host: str,
    ) -> None:
        self._model = model
        self._data = data
        self._ripples = ripples
        self._hand = Hand(model)
        self._is_running = True
        self._is_closed = False
        self._is_paused = False
        self._actions: dict[str, Callable[[Command], None]] = {
            "poke": self._poke,
            "drag": self._drag,
            "drop": self._drop,
            "pause": lambda command: self._pause(True),
            "resume": lambda command: self._pause(False),
            "quit": self._quit,
        }
        self._pages = Pages(source, data, self._menu)
        self._server = PageServer(self._pages, port, host, framed_by=_NOTEBOOKS)
        self._server.start()
        self.address = self._server.address

    def is_running(self) -> bool:
        """Whether nobody has left the page by Q, and `close` was not called."""
        return self._is_running

    def sync(self) -> None:
        """Show the present state, and take in pokes and pulls; returns at once without a page.

        It waits while the page is paused or behind.
        """
        while self._is_running:
            with self._pages.lock:
                self._pages.carry_out(self._actions)
                if not (self._is_paused or self._pages.is_behind):
                    self._hand.pull(self._data)
                    self._pages.send(self._ripples.last_impulses)
                    return
            time.sleep(_PATIENCE)

    def close(self) -> None:
        """End the page. Repeated calls do nothing."""
        self._is_running = False
        if not self._is_closed:
            self._is_closed = True
            self._pages.end()
            self._server.stop()

    def _menu(self) -> dict[str, Any]:
        """What the controls of a page offer."""
        movable = np.flatnonzero(self._model.body_dofnum)
        return {
            "operators": [],
            "operator": "",
            "presets": [],
            "looks": [],
            "chosen": [{"preset": "", "look": ""} for _ in self._ripples],
            "commands": list(self._actions),
            "paused": self._is_paused,
            "movable": movable.tolist(),
        }

    def _poke(self, command: Command) -> None:
        waves = self._ripples[target_of(command, list(self._ripples))]
        size = float(np.ptp(waves.rest.mesh.V, axis=0).max())
        radius, impulse = poke_strength(waves.material, size)
        waves.add_impulse(command.point, command.strength * impulse, radius)

    def _drag(self, command: Command) -> None:
        self._hand.hold(self._data, command.body, command.point, command.way)

    def _drop(self, command: Command) -> None:
        self._hand.let_go(self._data)

    def _pause(self, paused: bool) -> None:
        self._is_paused = paused
        self._pages.tell(paused=paused)

    def _quit(self, command: Command) -> None:
        self._is_running = False

    def _repr_html_(self) -> str:
        """HTML for a notebook: the page."""
        source = html.escape(self.address, quote=True)
        return (
            f'<iframe src="{source}" width="100%" height="{_FRAME_HEIGHT}" style="border: 0" '
            "allowfullscreen></iframe>"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@checked(
    SceneError,
    ripples=instance(Ripples, ", for instance Ripples(model, materials)"),
)
def view(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ripples: Ripples,
    *,
    camera: str | CameraEntry | None = None,
    looks: ByGeom[str] | None = None,
    lighting: str = "auto",
    port: int = 0,
    host: str = "127.0.0.1",
    browser: bool = True,
) -> LoopView:
    """Show a loop of one's own in the browser.

    The page solves the waves itself, and gets poses and loads at each `LoopView.sync`. It can be
    poked, and bodies can be dragged: `data.xfrc_applied` of a body that is dragged is overwritten.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    ripples : Ripples
    camera, looks, lighting
        As for `Exporter`.
    port : int
        Of the page; 0: a free one.
    host : str
        Address of the page. Any but 127.0.0.1 lets other machines see and control the loop.
    browser : bool
        Open the page where there is a screen.

    Raises
    ------
    RippleError
        If data, ripples or an argument do not belong to the model, or the port is not free.
    """
    check_port(port, host)
    model = own_model(model)
    source = loop_source(
        model,
        ripples,
        camera=camera,
        looks=looks,
        lighting=lighting,
        fps=_FPS,
        size=_PICTURE_SIZE,
        tessellation="refined",
        triangles=MOST_TRIANGLES,
    )
    shown = LoopView(model, own_data(model, data), ripples, source, port, host)
    print(shown.address, flush=True)
    if browser and display_problem() is None:
        webbrowser.open(shown.address)
    return shown
