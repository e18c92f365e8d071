"""`FrameSource`: snapshots of a simulation rendered to frames, offscreen."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId, target_of_skin
from ripple_sim.render import Camera, FixedCamera, Renderer, Surface
from ripple_sim.render.height_map_textures import AnyHeightMap, MovedHeightMap
from ripple_sim.render.surfaces.surface import Charts
from ripple_sim.simulation import Simulation
from ripple_sim.solver import SphereAtlas, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.texels.chart_page import ChartPage

from .exposure import FilmExposure
from .scene_camera import focal_distance, viewpoint
from .shown_waves import ShownWaves
from .sighting import Sighting
from .snapshot import Snapshot, exposures_of

# Texels along a chart's edge of the sphere that is drawn: the mesh of a sphere's atlas has a vertex
# for each texel, more than pictures need.
_MAX_SPHERE_RESOLUTION = 32


def surface_of(
    waves: WaveSolver, look: str, color: tuple[float, float, float] | None = None
) -> Surface:
    """The surface that is drawn for a target."""
    atlas = waves.rest
    drawn = atlas
    if isinstance(atlas, SphereAtlas) and atlas.resolution > _MAX_SPHERE_RESOLUTION:
        drawn = sphere_atlas(atlas.radius, _MAX_SPHERE_RESOLUTION)
    mesh = drawn.mesh
    return Surface(
        V=mesh.V,
        F=mesh.F,
        charts=Charts(drawn.chart_map, ChartPage(len(atlas.areas), atlas.resolution)),
        look=look,
        color=color,
        uv=mesh.uv if mesh.corner_uv is None else mesh.corner_uv,
        moving=None if drawn is atlas else (atlas.mesh.V, atlas.mesh.F),
    )


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

    Attributes
    ----------
    renderer : Renderer
    shown : ShownWaves
        Heights of the waves in the pictures so far.
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
        self.width = width
        self.height = height
        self._simulation = simulation
        _, self._lens_points = exposures_of(simulation.scene.camera)
        self._exposure = FilmExposure(supersample, len(self._lens_points))
        self._geoms = simulation.ripples.geom_ids
        self.shown = ShownWaves(simulation.ripples, height)
        surfaces = {
            self._geoms[entry.geom]: annotate(
                surface_of(simulation.ripples[entry.geom], entry.look, entry.color)
            )
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
        """Render an exposure; return the frame after its last exposure, None before.

        The frame is [height, width, 3], or [height, width, 4] if it is transparent.
        """
        self.submit(snapshot)
        return self.fetch()

    def submit(self, snapshot: Snapshot) -> None:
        """Begin to draw a snapshot; `fetch` returns the frames in this order."""
        pose = self.camera(snapshot).pose()
        impulses = [] if snapshot.exposure else snapshot.impulses
        self.shown.look(snapshot.data, snapshot.heights, pose, impulses)
        lens_point = self._lens_points[snapshot.exposure]
        if lens_point.any():
            model = self._simulation.model
            entry = self._simulation.scene.camera
            focus = focal_distance(model, snapshot.data, entry, pose)
            pose = dataclasses.replace(pose, lens=tuple(lens_point), focal_distance=focus)
        height_maps = self._height_maps_by_geom(snapshot)
        self.renderer.submit(snapshot.data, height_maps, pose, snapshot.exposure)

    def fetch(self) -> NDArray | None:
        """Wait for the earliest submitted snapshot; return the frame, or None as `render` does."""
        return self._exposure.expose(self.renderer.fetch())

    def sighting(self, snapshot: Snapshot) -> Sighting:
        """The sighting of a snapshot, through the middle of the camera's lens."""
        data = snapshot.data
        height_maps = self._height_maps_by_geom(snapshot)
        camera = self.camera(snapshot)
        image = self.renderer.surfaces(data, height_maps, camera, (self.width, self.height))
        height_arrays = {}
        meshes = {}
        for name, geom in self._geoms.items():
            mesh = self._simulation.ripples[name].rest.mesh
            height_map = height_maps[geom]
            height_arrays[geom] = np.asarray(height_map)
            V = height_map.V if isinstance(height_map, MovedHeightMap) else mesh.V
            meshes[geom] = (V, mesh.F)
        model = self._simulation.model
        # soft targets come after the geoms; their frame is the world's
        soft_count = target_of_skin(model, model.nskin) - model.ngeom
        positions = np.concatenate([data.geom_xpos, np.zeros((soft_count, 3))])
        rotations = np.concatenate(
            [data.geom_xmat.reshape(-1, 3, 3), np.tile(np.eye(3), (soft_count, 1, 1))]
        )
        return Sighting(image, camera.pose(), positions, rotations, height_arrays, meshes)

    def camera(self, snapshot: Snapshot) -> Camera | FixedCamera:
        """Camera of a snapshot, through the middle of its lens."""
        simulation = self._simulation
        data = snapshot.data
        return viewpoint(simulation.model, data, simulation.scene.camera, data.time)

    def _height_maps_by_geom(self, snapshot: Snapshot) -> dict[TargetId, AnyHeightMap]:
        return {self._geoms[name]: height_map for name, height_map in snapshot.height_maps.items()}
