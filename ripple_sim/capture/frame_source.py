"""`FrameSource`: snapshots of a simulation rendered to frames, offscreen."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render import Camera, FixedCamera, Renderer, Surface
from ripple_sim.render.camera import ThroughLens, Viewpoint
from ripple_sim.render.height_maps import AnyHeightMap, MovedHeightMap
from ripple_sim.simulation import Simulation
from ripple_sim.solver.gl import shared_context

from .exposure import Exposures
from .passes import SeenMesh, Sighting
from .sensor import Sensor
from .snapshot import Snapshot
from .target_surface import surface_of
from .viewpoint import focal_distance, viewpoint


class FrameSource:
    """Renders snapshots of a simulation in the process's shared OpenGL context.

    Parameters
    ----------
    simulation : Simulation
        Whose model, targets and camera are drawn.
    width, height : int
        Of the frames [pixels].
    supersample : int
        Frames are drawn this many times as wide and high, and averaged in linear light.
    transparent : bool
        Frames have a fourth channel, their opacity: the background is left out.
    linear : bool
        Frames are linear light, float16, multiplied by opacity; otherwise sRGB, uint8.
    annotate : callable, optional
        Adds a heatmap or a grid to a target's surface before it is drawn.
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
    ) -> None:
        self.width, self.height = width, height
        self._simulation = simulation
        self._exposures = Exposures.of(simulation.scene.camera)
        self._sensor = Sensor(supersample, len(self._exposures))
        self._geoms = simulation.ripples.geom_ids
        surfaces = {
            self._geoms[entry.geom]: annotate(surface_of(simulation.ripples[entry.geom], entry.look, entry.color))
            for entry in simulation.scene.targets
        }
        self.renderer = Renderer(
            shared_context(),
            simulation.model,
            surfaces,
            size=(supersample * width, supersample * height),
            lighting=simulation.scene.lighting,
            alpha=transparent,
            linear=linear,
        )

    def render(self, snapshot: Snapshot) -> NDArray | None:
        """Render an exposure; return the frame after its last, [height, width, 3], or 4 if it is transparent."""
        self.submit(snapshot)
        return self.fetch()

    def submit(self, snapshot: Snapshot) -> None:
        """Draw a snapshot without waiting for it: `fetch` returns it, after those submitted before."""
        height_maps = {self._geoms[name]: height_map for name, height_map in snapshot.height_maps.items()}
        camera: Viewpoint = self.camera(snapshot)
        lens = self._exposures.offsets[snapshot.exposure]
        if lens.any():
            sim = self._simulation
            focus = focal_distance(sim.model, snapshot.data, sim.scene.camera, camera.pose())
            camera = ThroughLens(camera, tuple(lens), focus)
        self.renderer.submit(snapshot.data, height_maps, camera, snapshot.exposure)

    def fetch(self) -> NDArray | None:
        """Wait for the earliest snapshot submitted, and return what `render` does."""
        return self._sensor.expose(self.renderer.fetch())

    def sighting(self, snapshot: Snapshot) -> Sighting:
        """What the camera sees at a snapshot, through the middle of its lens."""
        height_maps = {self._geoms[name]: height_map for name, height_map in snapshot.height_maps.items()}
        camera = self.camera(snapshot)
        image = self.renderer.surfaces(snapshot.data, height_maps, camera, (self.width, self.height))
        read = {geom: np.asarray(height_map) for geom, height_map in height_maps.items()}
        return Sighting.of(image, camera.pose(), snapshot.data, read, self._meshes(height_maps))

    def _meshes(self, height_maps: Mapping[int, AnyHeightMap]) -> dict[int, SeenMesh]:
        """The meshes of the targets where they are at a snapshot."""
        meshes = {}
        for name, geom in self._geoms.items():
            mesh, height_map = self._simulation.ripples[name].rest.mesh, height_maps[geom]
            meshes[geom] = SeenMesh(height_map.V if isinstance(height_map, MovedHeightMap) else mesh.V, mesh.F)
        return meshes

    def camera(self, snapshot: Snapshot) -> Camera | FixedCamera:
        """Camera of a snapshot, through the middle of its lens."""
        sim = self._simulation
        return viewpoint(sim.model, snapshot.data, sim.scene.camera, snapshot.data.time)
