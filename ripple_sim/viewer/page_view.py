"""`PageView`: a session in browsers: it advances in real time and carries out their commands.

MuJoCo and the waves run here; the pages get poses, loads and pokes, solve the waves themselves and
draw.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.export.exporter import Exporter, scene_source
from ripple_sim.export.options import ExportOptions
from ripple_sim.export.renderer import RippleRenderer
from ripple_sim.export.source import Source
from ripple_sim.render.visuals.visual import LOOKS
from ripple_sim.solver import RippleError
from ripple_sim.solver.operator.presets import PRESETS

from .choices import Choices
from .hand import Hand
from .opening import Opened
from .pages import ALL_TARGETS, Command, Pages, target_of
from .recorder import Recorder
from .saved_scene import moved_camera, save_scene
from .session import OPERATORS, Session

# Size of recordings [pixels].
_RECORDED_SIZE = (1280, 720)


class PageView:
    """A session that pages show and command.

    Parameters
    ----------
    session : Session
    source : Source
        What the pages show.
    folder : path
        Where recordings, pages and scenes go.
    origin : Opened, optional
        What the scene was made from; without it no scene can be saved.

    Attributes
    ----------
    pages : Pages
    closed : bool
        Whether the user wants to leave.
    """

    def __init__(
        self,
        session: Session,
        source: Source,
        folder: str | Path = ".",
        origin: Opened | None = None,
    ) -> None:
        simulation = session.simulation
        self.session = session
        self.folder = Path(folder)
        self.closed = False
        self.pages = Pages(source, simulation.data, self._menu)
        self._source = source
        self._paints = source.paints  # the scene's own
        self._origin = origin
        self._hand = Hand(simulation.model)
        self._recorder = Recorder(self.folder, simulation.scene.name, session.fps)
        self._renderer: RippleRenderer | None = None
        self._camera: mujoco.MjvCamera | int = -1
        self._choices = Choices(simulation.ripples)
        self._actions: dict[str, Callable[[Command], None]] = {
            "poke": self._poke,
            "throw": self._throw,
            "drag": self._drag,
            "drop": self._drop,
            "pause": lambda command: self._pause(True),
            "resume": lambda command: self._pause(False),
            "step": self._step,
            "reset": self._reset,
            "operator": self._change_operator,
            "compare": self._compare,
            "preset": self._change_preset,
            "look": self._change_look,
            "factors": self._change_factors,
            "record": self._record,
            "share": self._share,
            "save": self._save,
            "quit": self._quit,
        }

    def run(self) -> None:
        """Advance frame by frame, at most in real time, until a page or the program ends it."""
        frame = 1 / self.session.fps
        due = time.perf_counter()
        try:
            while not self.closed:
                self.tick()
                due = max(due + frame, time.perf_counter() - frame)
                time.sleep(max(0.001, due - time.perf_counter()))
        finally:
            self.close()

    def tick(self) -> None:
        """Carry out commands, and advance by a frame if a page waits for one."""
        with self.pages.lock:
            self.pages.carry_out(self._actions)
            if self.pages.ready and not self.session.paused:
                self._advance()

    def close(self) -> None:
        """End all pages, and a recording."""
        self.closed = True
        self.pages.end()
        self._recorder.stop()
        self._close_renderer()

    def _close_renderer(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _menu(self) -> dict[str, Any]:
        """What the controls of a page offer."""
        movable = np.flatnonzero(self.session.simulation.model.body_dofnum)
        return {
            "operators": OPERATORS,
            "presets": list(PRESETS),
            "looks": list(LOOKS),
            "chosen": self._choices.by_target(),
            "commands": list(self._actions),
            "operator": self.session.operator,
            "paused": self.session.paused,
            "movable": movable.tolist(),
        }

    def _advance(self) -> None:
        """Advance by a frame, and send it."""
        self._hand.pull(self.session.simulation.data)
        try:
            self.session.simulation.advance_frame()
        except RippleError as error:
            self._pause(True)
            self.pages.tell(say=f"{error}; restart with R")
        self.pages.send(self.session.simulation.impulses)
        if self._recorder.recording:
            self._recorder.add(self._picture())

    def _poke(self, command: Command) -> None:
        ripples = self.session.simulation.ripples
        name = target_of(command, list(ripples))
        radius = self.session.poke_radius
        impulse = command.strength * self.session.poke_impulse
        ripples[name].add_impulse(command.point, impulse, radius)

    def _throw(self, command: Command) -> None:
        if not self.session.throw(command.point, command.way):
            raise ValueError("this scene has no ball to throw")

    def _drag(self, command: Command) -> None:
        """Pull a body: `point` is where it was taken, in its frame, and `way` where that goes."""
        data = self.session.simulation.data
        self._hand.hold(data, command.body, command.point, command.way)

    def _drop(self, command: Command) -> None:
        self._hand.let_go(self.session.simulation.data)

    def _pause(self, paused: bool) -> None:
        self.session.paused = paused
        self.pages.tell(paused=paused)

    def _step(self, command: Command) -> None:
        self._pause(True)
        self._advance()

    def _reset(self, command: Command) -> None:
        self._drop(command)
        self.session.reset()
        if not self._choices.is_empty:
            self._choices.apply()
        self.pages.tell(reset=True)
        self.pages.send([])

    def _change_operator(self, command: Command) -> None:
        self.session.set_operator(command.name)
        self.pages.send([])
        self.pages.tell(operator=self.session.operator)

    def _compare(self, command: Command) -> None:
        """Show the waves of another operator beside the run's, or no longer for an empty name."""
        if command.name and command.name not in OPERATORS:
            valid = ", ".join(OPERATORS)
            raise ValueError(f"operator must be one of {valid}, got {command.name[:40]!r}")
        self.pages.send([])
        self.pages.compare(command.name)

    def _change_preset(self, command: Command) -> None:
        """Give targets a real material, or their own again for an empty name."""
        self._choices.choose_preset(self._targets(command), command.name)
        self.pages.send([])
        self.pages.tell(chosen=self._choices.by_target())

    def _change_look(self, command: Command) -> None:
        """Give targets a look, or their own again for an empty name."""
        targets = self._targets(command)
        self._choices.choose_look(targets, command.name)
        paints = dict(self._source.paints)
        for name in targets:
            own, color = self._paints[name]
            paints[name] = (self._choices.look(name) or own, color)
        self._source = dataclasses.replace(self._source, paints=paints)
        self.pages.repaint(self._source, targets)
        self.pages.tell(chosen=self._choices.by_target())
        self._close_renderer()  # the next picture has one with these looks

    def _targets(self, command: Command) -> list[str]:
        """The targets that a command means: one, or all."""
        names = list(self.session.simulation.ripples)
        return names if command.target == ALL_TARGETS else [target_of(command, names)]

    def _change_factors(self, command: Command) -> None:
        """Multiply coefficients of the materials that are chosen."""
        self._choices.choose_factors(command.factors)
        self.pages.send([])

    def _record(self, command: Command) -> None:
        """Begin a video by the real renderer, from the page's camera, or end it."""
        if self._recorder.recording:
            self.pages.tell(say=f"wrote {self._recorder.stop()}")
            return
        self._camera = free_camera(command.camera)
        picture = self._picture()
        self.pages.tell(say=f"recording {self._recorder.start(picture)}")
        self._recorder.add(picture)

    def _picture(self) -> NDArray[np.uint8]:
        simulation = self.session.simulation
        if self._renderer is None:
            width, height = _RECORDED_SIZE
            paints = self._source.paints
            looks = {name: look for name, (look, _) in paints.items()}
            colors = {name: color for name, (_, color) in paints.items() if color is not None}
            self._renderer = RippleRenderer(
                simulation.model,
                simulation.ripples,
                height,
                width,
                looks=looks,
                colors=colors,
                lighting=self._source.lighting,
            )
        self._renderer.update_scene(simulation.data, camera=self._camera)
        return self._renderer.render()

    def _share(self, command: Command) -> None:
        """Write the present state as a page of its own, which needs no server."""
        path = self._new_path(".html")
        with Exporter.of(self._source, path) as exporter:
            exporter.write(self.session.simulation.data, [])
        self.pages.tell(say=f"wrote {path}")

    def _save(self, command: Command) -> None:
        """Write a scene file of what is shown, seen from the page's camera if that has moved."""
        if self._origin is None:
            raise ValueError("there is no file that this scene was made from; it cannot be saved")
        path = self._new_path(".toml", ".xml")
        shown = self._origin.scene
        targets = [self._choices.chosen(entry) for entry in shown.targets]
        camera = moved_camera(shown, command.camera) if command.camera else shown.camera
        try:
            save_scene(self._origin, targets, camera, path)
        except OSError as error:
            raise ValueError(f"{str(path)!r} cannot be written: {error.strerror}") from error
        self.pages.tell(say=f"wrote {path}")

    def _new_path(self, *endings: str) -> Path:
        """The path NAME-NUMBER in the folder with the first ending, where no ending exists yet."""
        name = self.session.simulation.scene.name
        for number in itertools.count(1):
            paths = [self.folder / f"{name}-{number}{ending}" for ending in endings]
            if not any(path.exists() for path in paths):
                break
        return paths[0]

    def _quit(self, command: Command) -> None:
        self.closed = True


def free_camera(entry: dict[str, Any]) -> mujoco.MjvCamera | int:
    """The free camera of a page: lookat, distance, azimuth and elevation; MuJoCo's without."""
    if not entry:
        return -1
    camera = mujoco.MjvCamera()
    camera.lookat = entry["lookat"]
    camera.distance = entry["distance"]
    camera.azimuth = entry["azimuth"]
    camera.elevation = entry["elevation"]
    return camera


def view_of(
    session: Session, folder: str | Path, resolution: int | None, origin: Opened | None = None
) -> PageView:
    """The view of a session of a scene; `origin` is what the scene was made from."""
    simulation = session.simulation
    options = ExportOptions(fps=session.fps, resolution=resolution)
    return PageView(session, scene_source(simulation.scene, simulation, options), folder, origin)
