"""One simulation, or two side by side, with overlays: the states of a video and their pictures."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.snapshot import FrameSource, Snapshot, run
from ripple_sim.overlay.colormap import color_table
from ripple_sim.overlay.comparison import TITLES
from ripple_sim.overlay.field import grid_spacing
from ripple_sim.overlay.layout import Layout
from ripple_sim.overlay.marks import PlacedMark, draw_marks, place_marks
from ripple_sim.overlay.notes import Notebook, Notes
from ripple_sim.overlay.painter import Painter
from ripple_sim.overlay.projection import Projection
from ripple_sim.render import Surface
from ripple_sim.scene.overlays import Request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.gl import GLContext


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """An exposure of a film's frame: a snapshot of each run, and what the overlays show, the same all frame long."""

    snapshots: tuple[Snapshot, ...]
    notes: Notes

    @property
    def number(self) -> int:
        """Of the frame, from 0."""
        return self.snapshots[0].number

    @property
    def exposure(self) -> int:
        """Of the frame's exposures, from 0."""
        return self.snapshots[0].exposure

    def digest(self) -> str:
        """Fingerprint of all runs, see `Snapshot.digest`."""
        return "".join(snapshot.digest() for snapshot in self.snapshots)


class Film:
    """Simulations of one scene that run in step, and their frames.

    Parameters
    ----------
    simulations : sequence of Simulation
        One, or two that are shown side by side.
    request : Request
        The overlays.
    width, height : int
        Of the frames [pixels]; two runs share the width.
    frames : int
        How many.
    rate : float
        Frames in a second of the scene's time.
    operators : sequence of str
        Those of the runs, for their titles where there are two.
    supersample, transparent, linear
        As for `FrameSource`; linear frames are without overlays, and of one run.
    gl : GLContext, optional
        By default the process's shared one.

    Attributes
    ----------
    seconds : float
        Time spent on frames so far [s].
    """

    def __init__(
        self,
        simulations: Sequence[Simulation],
        request: Request,
        *,
        width: int,
        height: int,
        frames: int,
        rate: float,
        operators: Sequence[str] = (),
        supersample: int = 1,
        transparent: bool = False,
        linear: bool = False,
        gl: GLContext | None = None,
    ) -> None:
        self.simulations, self._request, self._frames = simulations, request, frames
        self._layout = Layout(width, height)
        self._notebook = Notebook(request, simulations, frames, rate)
        self._drawing: dict[str, Any] = {
            "supersample": supersample,
            "transparent": transparent,
            "linear": linear,
            "gl": gl,
        }
        self._sources: list[FrameSource] = []
        self._submitted: deque[Shot] = deque()
        self._marks: list[list[PlacedMark]] = []
        self.seconds = 0.0
        self._painter = Painter(
            request,
            self._layout,
            duration=frames / rate,
            spacing=_common_spacing(simulations[0]),
            titles=[TITLES[operator] for operator in operators] if len(operators) > 1 else [],
        )

    def prepare(self) -> None:
        """Make the renderers, which takes a while, before the first `draw` does; the simulations may run meanwhile."""
        if self._sources:
            return
        count, width, height = len(self.simulations), self._layout.width, self._layout.height
        ends = [round(width * k / count) for k in range(count + 1)]
        self._sources = [
            FrameSource(simulation, width=right - left, height=height, annotate=self._annotated, **self._drawing)
            for simulation, left, right in zip(self.simulations, ends[:-1], ends[1:], strict=True)
        ]

    def states(self, alive: int = 1) -> Iterator[Shot]:
        """Run the simulations; see `ripple_sim.frames.run`."""
        runs = [run(simulation, self._frames, alive=alive) for simulation in self.simulations]
        for snapshots in zip(*runs, strict=True):
            if snapshots[0].exposure == 0:
                notes = self._notebook.follow()
            yield Shot(snapshots, notes)

    def draw_all(self, shots: Iterable[Shot], ahead: int = 0) -> Iterator[NDArray]:
        """Draw frames in their order, as `draw` does, and wait for each shot when `ahead` later ones are submitted."""
        for shot in shots:
            self.submit(shot)
            if len(self._submitted) > ahead and (frame := self.fetch()) is not None:
                yield frame
        while self._submitted:
            if (frame := self.fetch()) is not None:
                yield frame

    def draw(self, shot: Shot) -> NDArray | None:
        """Draw an exposure; return the frame after its last, [height, width, 3], or 4 if it is transparent."""
        self.submit(shot)
        return self.fetch()

    def submit(self, shot: Shot) -> None:
        """Draw an exposure without waiting for it: `fetch` returns what `draw` does, after those submitted before.

        The shot must stay as it is until then.
        """
        self.prepare()
        start = time.perf_counter()
        for number, (source, snapshot) in enumerate(zip(self._sources, shot.snapshots, strict=True)):
            if self._request.field and shot.exposure == 0:
                geoms = self.simulations[number].ripples.geom_ids
                for name, field in shot.notes.fields[number].items():
                    source.renderer.set_heatmap(geoms[name], field, shot.notes.field_scale.value)
            source.submit(snapshot)
        self._submitted.append(shot)
        self.seconds += time.perf_counter() - start

    def fetch(self) -> NDArray | None:
        """Wait for the earliest submitted exposure, and return what `draw` does."""
        start = time.perf_counter()
        shot = self._submitted.popleft()
        if shot.exposure == 0:
            self._marks = [self._placed_marks(run, shot) for run in range(len(self._sources))]
        pictures = [picture for source in self._sources if (picture := source.fetch()) is not None]
        frame = self._composed(pictures, shot) if pictures else None
        self.seconds += time.perf_counter() - start
        return frame

    def _composed(self, pictures: list[NDArray], shot: Shot) -> NDArray:
        """The pictures of the runs side by side, under the overlays."""
        for picture, marks in zip(pictures, self._marks, strict=True):
            draw_marks(picture, marks, self._layout)
        frame = pictures[0]
        if len(pictures) > 1:
            frame = np.concatenate(pictures, axis=1)
            seam, half = pictures[0].shape[1], max(1, round(self._layout.em / 16))
            frame[:, seam - half : seam + half] = 255
        self._painter.paint(frame, shot.notes)
        return frame

    def _placed_marks(self, run: int, shot: Shot) -> list[PlacedMark]:
        """Where the contacts of a run lie in its picture."""
        source, snapshot, notes = self._sources[run], shot.snapshots[run], shot.notes
        if not self._request.contacts:
            return []
        projection = Projection(source.camera(snapshot).pose(), source.width, source.height)
        hiding = self.simulations[run].model, snapshot.data
        return place_marks(notes.marks[run], notes.mark_scale.value, self._layout, projection, *hiding)

    def _annotated(self, surface: Surface) -> Surface:
        """A target with what the request asks for."""
        return dataclasses.replace(
            surface,
            heatmap_colors=color_table() if self._request.field else None,
            grid=grid_spacing(surface.resolution) if self._request.grid else 0,
        )


def _common_spacing(simulation: Simulation) -> int:
    """Texels between grid lines, 0 where the targets differ in it."""
    ripples = simulation.ripples
    spacings = {grid_spacing(ripples[name].atlas.resolution) for name in ripples}
    return spacings.pop() if len(spacings) == 1 else 0
