"""From a running simulation to pictures: a frozen copy of its state, and a renderer that draws such copies."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.render import Camera, FixedCamera, Renderer, Surface
from ripple_sim.render.camera import ThroughLens, Viewpoint
from ripple_sim.simulation import Simulation
from ripple_sim.solver import HeightMap
from ripple_sim.solver.gl import GLContext, shared_context

from .exposure import Exposures
from .ripple_renderer import surface_of
from .sensor import Sensor
from .shutter import Moments
from .viewpoint import focal_distance, viewpoint


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """A simulation's state at one exposure of a frame, which stays as it is while the simulation goes on.

    Attributes
    ----------
    number : int
        Of the frame, from 0.
    exposure : int
        Of the frame's exposures, from 0: that is the frame's own moment, at which the shutter opens.
    data : mujoco.MjData
        Copy of MuJoCo's state.
    heights, height_maps : dict
        By the geom's name: height [m], float32 [6, N, N], and what is drawn of it (see `HeightMap`).
    impulses : list of Impulse
        All of the frame, up to its own moment.
    """

    number: int
    exposure: int
    data: mujoco.MjData
    heights: dict[str, NDArray[np.float32]]
    height_maps: dict[str, NDArray[np.float32]]
    impulses: list[Impulse]

    def digest(self) -> str:
        """Fingerprint of the bodies' and the surfaces' state, the same if and only if every bit of it is."""
        hasher = hashlib.blake2b(digest_size=16)
        for array in (self.data.qpos, self.data.qvel, self.data.act, *self.heights.values()):
            hasher.update(array.tobytes())
        return hasher.hexdigest()


def run(simulation: Simulation, frames: int, *, alive: int = 1) -> Iterator[Snapshot]:
    """Advance a simulation frame by frame, and through the exposures of each frame that its camera takes.

    Parameters
    ----------
    simulation : Simulation
        At its beginning, where frame 0 stands.
    frames : int
        How many.
    alive : int
        How many of the latest snapshots are in use at a time; the state of older ones is written over.
    """
    ring = itertools.cycle([mujoco.MjData(simulation.model) for _ in range(alive)])
    ripples = simulation.ripples
    height_map_of = {name: HeightMap(ripples[name].atlas) for name in ripples}
    moments = Moments(simulation, Exposures.of(simulation.scene.camera).moments)
    for number in range(frames):
        if number:
            simulation.advance_frame()
        impulses, shown = simulation.impulses, None
        for exposure, (state, heights) in enumerate(moments):
            if heights is not shown:
                data, shown = next(ring), heights
                mujoco.mj_copyData(data, simulation.model, state)
                height_maps = {name: height_map_of[name](height) for name, height in heights.items()}
            yield Snapshot(number, exposure, data, heights, height_maps, impulses)


class FrameSource:
    """Draws snapshots of a simulation with the offscreen renderer.

    Parameters
    ----------
    simulation : Simulation
        Whose model, surfaces and camera are drawn.
    width, height : int
        [pixels].
    supersample : int
        The picture is drawn so many times as wide and high, and averaged in linear light.
    transparent : bool
        Frames have a fourth channel, their opacity: the background is left out.
    linear : bool
        Frames are linear light, float16, multiplied by opacity; otherwise sRGB, uint8.
    annotate : callable, optional
        What the surfaces are to be drawn as.
    gl : GLContext, optional
        By default the process's shared one.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        width: int,
        height: int,
        supersample: int = 1,
        transparent: bool = False,
        linear: bool = False,
        annotate: Callable[[Surface], Surface] = lambda surface: surface,
        gl: GLContext | None = None,
    ) -> None:
        self.width, self.height = width, height
        self._simulation = simulation
        self._exposures = Exposures.of(simulation.scene.camera)
        self._sensor = Sensor(supersample, len(self._exposures))
        self._geoms = simulation.ripples.geom_ids
        surfaces = {}
        for entry in simulation.scene.surfaces:
            surface = surface_of(simulation.ripples[entry.geom], entry.look, entry.color)
            surfaces[self._geoms[entry.geom]] = annotate(surface)
        gl = gl if gl is not None else shared_context()
        self.renderer = Renderer(
            gl,
            simulation.model,
            surfaces,
            size=(supersample * width, supersample * height),
            lighting=simulation.scene.lighting,
            alpha=transparent,
            linear=linear,
        )

    def draw(self, state: Snapshot) -> NDArray | None:
        """Draw an exposure; return the frame after its last, [height, width, 3], or 4 if it is transparent."""
        self.submit(state)
        return self.fetch()

    def submit(self, state: Snapshot) -> None:
        """Draw a snapshot without waiting for it: `fetch` returns it, after those submitted before."""
        height_maps = {self._geoms[name]: height_map for name, height_map in state.height_maps.items()}
        camera: Viewpoint = self.camera(state)
        lens = self._exposures.offsets[state.exposure]
        if lens.any():
            sim = self._simulation
            focus = focal_distance(sim.model, state.data, sim.scene.camera, camera.pose())
            camera = ThroughLens(camera, tuple(lens), focus)
        self.renderer.submit(state.data, height_maps, camera, state.exposure)

    def fetch(self) -> NDArray | None:
        """Wait for the earliest submitted snapshot's picture, and return it as `draw` does."""
        return self._sensor.expose(self.renderer.fetch())

    def camera(self, state: Snapshot) -> Camera | FixedCamera:
        """Camera of a snapshot, through the middle of its lens."""
        sim = self._simulation
        return viewpoint(sim.model, state.data, sim.scene.camera, state.data.time)
