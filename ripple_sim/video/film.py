"""`Film`: one simulation, or two side by side, rendered to frames with overlays."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.snapshot import snapshots
from ripple_sim.encode.images import PassFiles
from ripple_sim.overlay.colormap import color_table
from ripple_sim.overlay.comparison import TITLES, compared_operators
from ripple_sim.overlay.heatmap import grid_spacing
from ripple_sim.overlay.layout import Layout
from ripple_sim.overlay.marks_overlay import PlacedMark, draw_marks, place_marks
from ripple_sim.overlay.notes import Notebook
from ripple_sim.overlay.painter import Painter
from ripple_sim.overlay.projection import Projection
from ripple_sim.render import Surface
from ripple_sim.scene.overlays import parse_request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.kernel import work_clock

from .options import VideoOptions
from .pass_writer import PassWriter, segmented
from .shot import Shot


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
