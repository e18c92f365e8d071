"""`Canvas`: a session's stage drawn frame by frame, with texts over it, as a screenshot or a recording if asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray

from ripple_sim.encode.output import check_size
from ripple_sim.solver import RippleError

from .controls import help_text
from .orbit import level
from .recorder import Recorder
from .session import Session
from .stage import Stage

# The status line is rewritten this often [s]: text is slow to draw.
_STATUS_EVERY = 0.25


class Canvas:
    """A session in a PyVista plotter.

    Parameters
    ----------
    session : Session
    size : (width, height)
        [pixels].
    off_screen : bool
        Draw without a window: for the web page and for tests.
    folder : path
        Where screenshots and videos go.

    Attributes
    ----------
    plotter : pyvista.Plotter
    stage : Stage
    recorder : Recorder
    drawn : bool
        Whether the latest frame shows the present state.
    message : str
        Latest message to the user.
    seconds_drawing : float
        Time that drawing has taken so far [s].
    render : callable
        Draws the frame; a web page replaces it by its own, which also sends the frame.

    Raises
    ------
    VideoError
        If the size cannot be drawn.
    """

    def __init__(
        self,
        session: Session,
        *,
        size: tuple[int, int] = (800, 600),
        off_screen: bool = False,
        folder: str | Path = ".",
    ) -> None:
        check_size(*size)
        self.session = session
        self.message = ""
        self.seconds_drawing = 0.0
        self.drawn = False
        self._updates, self._since, self._rate = 0, time.perf_counter(), math.nan
        scene = session.simulation.scene
        self.recorder = Recorder(Path(folder), scene.name, session.fps)
        # where there is no display VTK warns of that, and then does without one
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
        self.plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), lighting="none", title=scene.name)
        # smooth edges cost software OpenGL four fifths of its speed
        self.plotter.render_window.SetMultiSamples(0)
        self.stage = Stage(self.plotter, session)
        self._text, self._help = (
            self.plotter.add_text(text, position=corner, font_size=size, color="black", shadow=False)
            for text, corner, size in (("", "upper_left", 9), (help_text(), "upper_right", 8))
        )
        self.render: Callable[[], object] = self.plotter.render_window.Render
        self.update()

    def pixels(self) -> NDArray[np.uint8]:
        """The latest frame, uint8 [height, width, 3]."""
        window, pixels = self.plotter.render_window, vtkUnsignedCharArray()
        width, height = window.GetSize()
        window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1]

    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.plotter.render_window.GetSize()

    def status(self) -> str:
        """Time, operator and state; in a second line the latest message."""
        session = self.session
        state = "paused" if session.paused else f"{self._rate:.0f} updates/s" if self._rate > 0 else ""
        recording = "   recording" if self.recorder.recording else ""
        return f"{session.time:.2f} s   operator {session.operator}   {state}{recording}\n{self.message}"

    def say(self, message: str) -> None:
        """Show a message in the status line."""
        self.message = message
        self._show_status()

    def hide_texts(self) -> None:
        """Leave the status line and the list of keys out of the frame."""
        for text in (self._text, self._help):
            text.SetVisibility(False)

    def toggle_help(self) -> None:
        """Show or hide the list of keys."""
        self._help.SetVisibility(not self._help.GetVisibility())
        self.mark_stale()

    def update(self) -> None:
        """Bring the stage up to date with the session."""
        self.stage.update()
        self.mark_stale()

    def mark_stale(self) -> None:
        """Have the frame drawn again at the next tick."""
        self.drawn = False

    def draw(self) -> None:
        """Draw the frame, and add it to a video that is being recorded."""
        now = time.perf_counter()
        self._updates += 1
        if now - self._since > _STATUS_EVERY:
            self._rate = self._updates / (now - self._since)
            self._updates, self._since = 0, now
            self._show_status()
        level(self.plotter.camera)
        self.plotter.renderer.ResetCameraClippingRange()
        self.render()
        self.drawn = True
        self.seconds_drawing += time.perf_counter() - now
        if self.recorder.recording:
            try:
                if not self.recorder.add(self.pixels()):
                    self.say("the window has changed its size: the recording has ended")
            except RippleError as error:
                self.say(str(error))

    def _show_status(self) -> None:
        if self._text.GetVisibility():
            self._text.set_text("upper_left", self.status())
        self.mark_stale()
