"""`Film`: one simulation, or two side by side, rendered to frames with overlays, and with passes beside them.

A `Shot` is everything that one exposure of a film shows.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.passes import Sighting, passes_of
from ripple_sim.capture.snapshot import Snapshot, snapshots
from ripple_sim.coupling.geoms import geom_name
from ripple_sim.encode.images import PassFiles
from ripple_sim.overlay.notes import TITLES, Notebook, Notes, color_table, compared_operators, grid_spacing
from ripple_sim.overlay.painter import Painter
from ripple_sim.overlay.panels import Layout, PlacedMark, Projection, draw_marks, place_marks
from ripple_sim.render import Surface
from ripple_sim.scene.scene import parse_request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.kernel import work_clock

from .options import VideoOptions


class PassWriter:
    """Writes the passes of one frame when the next one is seen, to which its pixels flow.

    Parameters
    ----------
    files : PassFiles
    names : tuple of str
        Of the passes.
    """

    def __init__(self, files: PassFiles, names: tuple[str, ...]) -> None:
        self._files, self._names = files, names
        self._last: tuple[int, Sighting] | None = None

    def add(self, source: FrameSource, snapshot: Snapshot) -> None:
        """Look at the first exposure of a frame."""
        sighting = source.sighting(snapshot)
        self._write(sighting)
        self._last = snapshot.number, sighting

    def finish(self) -> None:
        """Write the last frame's, where nothing flows."""
        self._write(None)

    def _write(self, later: Sighting | None) -> None:
        if self._last is not None:
            number, sighting = self._last
            self._files.write(number, passes_of(sighting, later, self._names))


def segmented(simulation: Simulation) -> dict[int, str]:
    """What each number of the segmentation stands for: 0 the background, from 1 on the geoms."""
    model = simulation.model
    soft = {target + 1: name for name, target in simulation.ripples.geom_ids.items() if target >= model.ngeom}
    return {0: "background", **{geom + 1: geom_name(model, geom) for geom in range(model.ngeom)}, **soft}


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """An exposure of a film's frame: a snapshot of each run, and the overlays' content, which a whole frame shares."""

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
        One, or two that are shown side by side and share the width.
    options : VideoOptions
        Settled. Linear frames are without overlays, and of one run.
    frames : int
        How many.
    on_frame : callable, optional
        Called with the first simulation at the time of each frame, in the thread that runs `shots`.

    Attributes
    ----------
    seconds : float
        Time spent on frames so far [s].
    """

    def __init__(
        self,
        simulations: Sequence[Simulation],
        options: VideoOptions,
        frames: int,
        on_frame: Callable[[Simulation], None] | None = None,
    ) -> None:
        self.simulations, self._options, self._frames, self._on_frame = simulations, options, frames, on_frame
        self._request = parse_request(options.overlay or ())
        self._layout = Layout(*options.size)
        self._notebook = Notebook(self._request, simulations, frames, options.rate)
        self._sources: list[FrameSource] = []
        self._submitted: deque[Shot] = deque()
        self._marks: list[list[PlacedMark]] = []
        self._passes: PassWriter | None = None
        self.seconds = 0.0
        operators = compared_operators(options.compare)
        self._painter = Painter(
            self._request,
            self._layout,
            duration=frames / options.rate,
            spacing=_common_spacing(simulations[0]),
            titles=[TITLES[operator] for operator in operators] if len(operators) > 1 else [],
        )

    def write_passes(self, output: Path) -> None:
        """Write the passes that the options ask for beside an output."""
        options = self._options
        files = PassFiles(output, options.pass_format, segmented(self.simulations[0]))
        self._passes = PassWriter(files, tuple(options.passes))

    def prepare(self) -> None:
        """Make the renderers, which takes a while, before the first frame; the simulations may run meanwhile."""
        if self._sources:
            return
        count, options = len(self.simulations), self._options
        ends = [round(self._layout.width * k / count) for k in range(count + 1)]
        self._sources = [
            FrameSource(
                simulation,
                width=right - left,
                height=self._layout.height,
                supersample=options.supersample,
                transparent=options.transparent,
                linear=options.linear,
                annotate=self._annotated,
            )
            for simulation, left, right in zip(self.simulations, ends[:-1], ends[1:], strict=True)
        ]

    def shots(self, alive: int = 1) -> Iterator[Shot]:
        """Run the simulations; `alive` of the latest shots stay valid, see `snapshots`."""
        runs = [snapshots(simulation, self._frames, alive=alive) for simulation in self.simulations]
        for exposures in zip(*runs, strict=True):
            if exposures[0].exposure == 0:
                notes = self._notebook.follow()
                if self._on_frame is not None:
                    self._on_frame(self.simulations[0])
            yield Shot(exposures, notes)

    def render_all(self, shots: Iterable[Shot], ahead: int = 0) -> Iterator[NDArray]:
        """Render frames in their order, and wait for each shot when `ahead` later ones are submitted."""
        for shot in shots:
            self.submit(shot)
            if len(self._submitted) > ahead and (frame := self.fetch()) is not None:
                yield frame
        while self._submitted:
            if (frame := self.fetch()) is not None:
                yield frame
        if self._passes is not None:
            self._passes.finish()

    def render(self, shot: Shot) -> NDArray | None:
        """Render an exposure; return the frame after its last, [height, width, 3], or 4 if it is transparent."""
        self.submit(shot)
        return self.fetch()

    def submit(self, shot: Shot) -> None:
        """Draw an exposure without waiting for it: `fetch` returns it, after those submitted before.

        The shot must stay as it is until then.
        """
        self.prepare()
        start = work_clock()
        for number, (source, snapshot) in enumerate(zip(self._sources, shot.snapshots, strict=True)):
            if self._request.heatmap and shot.exposure == 0:
                geoms = self.simulations[number].ripples.geom_ids
                for name, heatmap in shot.notes.heatmaps[number].items():
                    source.renderer.set_heatmap(geoms[name], heatmap, shot.notes.heatmap_scale.value)
            source.submit(snapshot)
            if self._passes is not None and shot.exposure == 0:
                self._passes.add(source, snapshot)
        self._submitted.append(shot)
        self.seconds += work_clock() - start

    def fetch(self) -> NDArray | None:
        """Wait for the earliest exposure submitted, and return what `render` does."""
        start = work_clock()
        shot = self._submitted.popleft()
        if shot.exposure == 0:
            self._marks = [self._placed_marks(run, shot) for run in range(len(self._sources))]
        halves = [half for source in self._sources if (half := source.fetch()) is not None]
        frame = self._composed(halves, shot) if halves else None
        self.seconds += work_clock() - start
        return frame

    def _composed(self, halves: list[NDArray], shot: Shot) -> NDArray:
        """The runs' images side by side, under the overlays."""
        for half, marks in zip(halves, self._marks, strict=True):
            draw_marks(half, marks, self._layout)
        frame = halves[0]
        if len(halves) > 1:
            frame = np.concatenate(halves, axis=1)
            middle, seam = halves[0].shape[1], max(1, round(self._layout.em / 16))
            frame[:, middle - seam : middle + seam] = 255
        self._painter.paint(frame, shot.notes)
        return frame

    def _placed_marks(self, run: int, shot: Shot) -> list[PlacedMark]:
        """Contact marks of a run, in pixels of its image."""
        source, snapshot, notes = self._sources[run], shot.snapshots[run], shot.notes
        if not self._request.contacts:
            return []
        projection = Projection(source.camera(snapshot).pose(), source.width, source.height)
        hiding = self.simulations[run].model, snapshot.data
        return place_marks(notes.marks[run], notes.mark_scale.value, self._layout, projection, *hiding)

    def _annotated(self, surface: Surface) -> Surface:
        """A target's surface with the heatmap and the grid that the request asks for."""
        return dataclasses.replace(
            surface,
            heatmap_colors=color_table() if self._request.heatmap else None,
            grid=grid_spacing(surface.charts.page.resolution) if self._request.grid else 0,
        )


def _common_spacing(simulation: Simulation) -> int:
    """Texels between grid lines, 0 where the targets differ in it."""
    ripples = simulation.ripples
    spacings = {grid_spacing(ripples[name].atlas.resolution) for name in ripples}
    return spacings.pop() if len(spacings) == 1 else 0
