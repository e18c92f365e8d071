"""`Window`: a canvas that runs, with the user's keys, clicks and sliders."""

from __future__ import annotations

from pathlib import Path

from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import is_software

from .actions import Actions
from .canvas import Canvas
from .controls import CONTROLS
from .input import Input
from .session import Session
from .sliders import add_sliders

_MULTISAMPLES = 8


class Window(Canvas):
    """A session on screen or off, see `Canvas`, with its user's input.

    Attributes
    ----------
    actions : Actions
    """

    def __init__(
        self,
        session: Session,
        *,
        size: tuple[int, int] = (800, 600),
        off_screen: bool = False,
        folder: str | Path = ".",
    ) -> None:
        super().__init__(session, size=size, off_screen=off_screen, folder=folder)
        self._sliders = add_sliders(self.plotter, session)
        self._input = Input(self.plotter)
        self.actions = Actions(self, self._input)
        self._input.observe(self.key, self.actions.poke_at)
        self.plotter.iren.add_observer("RenderEvent", lambda *_: self.mark_stale())
        self.plotter.iren.add_observer("ExitEvent", lambda *_: self.actions.quit())

    @property
    def closed(self) -> bool:
        """Whether the user wants to leave."""
        return self.actions.closed

    def open(self) -> None:
        """Show the window."""
        self.plotter.show(interactive_update=True, auto_close=False, interactive=False)
        if not is_software(self.gl_renderer):
            self.plotter.render_window.SetMultiSamples(_MULTISAMPLES)
        # the loop draws, once a frame; sliders and the camera would draw at every movement of the pointer
        self.plotter.iren.interactor.EnableRenderOff()
        self.mark_stale()

    def close(self) -> None:
        """Close the window and finish a video."""
        self.actions.quit()
        try:
            self.recorder.stop()
        finally:
            self.plotter.close()

    def tick(self, draw: bool = True) -> bool:
        """Advance by one frame, and draw it if asked to; return whether there was anything new and it was drawn."""
        try:
            moved = self.session.advance()
        except RippleError as error:
            self.say(f"{error}; r: reset")
            moved = True
        if moved:
            self.update()
        if self.drawn or not draw:
            return False
        self.draw()
        return True

    @property
    def gl_renderer(self) -> str:
        """OpenGL driver of an open window, by its own name."""
        lines = self.plotter.render_window.ReportCapabilities().splitlines()
        return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer")), "none")

    def key(self, name: str) -> None:
        """Carry out the action of a key, in upper or lower case; other keys do nothing."""
        for control in CONTROLS:
            if name.lower() == control.key:
                getattr(self.actions, control.action)()
