"""`FrameSource`: snapshots of a simulation rendered to frames, offscreen.

Where the scene's camera stands at a time and what it is focused on, which surface is drawn of a
target, the sensor that averages the finer pixels and the exposures of a frame in linear light, and
passes: what a frame's pixels show, as numbers: distances, normals, geoms, positions, heights and
motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import first_skin
from ripple_sim.render import Camera, FixedCamera, Renderer, Surface
from ripple_sim.render.height_map_textures import MovedHeightMap
from ripple_sim.render.pose import Pose
from ripple_sim.render.surface_image import SurfaceImage
from ripple_sim.render.surfaces.adaptive import spline_heights, spline_samples
from ripple_sim.render.surfaces.moving import MovingVertices
from ripple_sim.render.surfaces.surface import Charts
from ripple_sim.render.tone_mapping import linear_to_srgb, srgb_to_linear
from ripple_sim.scene.scene_file import CameraEntry
from ripple_sim.simulation import Simulation
from ripple_sim.solver import SphereAtlas, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.kernel import Floats32, kernel
from ripple_sim.solver.texels.chart_page import ChartPage

from .snapshot import ShownWaves, Snapshot, exposures_of

# Steps of the table from linear light to sRGB: enough that each of the 256 values has entries, the
# darkest too.
_FINE = 1 << 14
_LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
_SRGB = np.rint(255 * linear_to_srgb(np.arange(_FINE + 1) / _FINE)).astype(np.uint8)

# Resolution of the sphere that is drawn: the mesh of its atlas has a vertex a texel, more than
# pictures need.
_SPHERE = 32
_NEAREST = 0.02  # least focal distance, in camera distances: the near plane


@dataclasses.dataclass(frozen=True, eq=False)
class Sighting:
    """What the camera sees at a time.

    Attributes
    ----------
    image : SurfaceImage
    pose : Pose
        Of the camera.
    positions, rotations : float64 [geom_count, 3], [geom_count, 3, 3]
        Of the geoms [m].
    height_maps : mapping
        By geom id, float32 [C, n + 2, n + 2, 4].
    meshes : mapping
        Likewise, vertices [n, 3] [m] and triangles [m, 3] of the targets, in their frames.
    """

    image: SurfaceImage
    pose: Pose
    positions: NDArray[np.float64]
    rotations: NDArray[np.float64]
    height_maps: Mapping[int, NDArray[np.float32]]
    meshes: Mapping[int, tuple[NDArray, NDArray]]

    @property
    def positions_seen(self) -> NDArray[np.float64]:
        """Points in the world [m], [height, width, 3]; 0 where nothing is."""
        depth = self.image.depth
        return np.where(depth[..., None] > 0, self.pose.points(depth), 0.0)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points [..., 3] of the world [m] are in the frame: columns and rows, 0.5 in the first one's middle."""
        height, width = self.image.depth.shape
        return self.pose.pixels(points, (width, height))[0]

    def flow_to(self, later: Sighting) -> NDArray[np.float32]:
        """How far each pixel's surface point moves in the frame [pixels], to the right and down, [height, width, 2].

        The point rides on its geom, on a target that moves with its mesh, and on the waves, along
        the smooth normal. 0 where nothing is.
        """
        image = self.image
        seen = self.positions_seen
        flow = np.zeros((*image.depth.shape, 2), np.float32)
        for geom in np.unique(image.geom[image.geom >= 0]):
            mask = image.geom == geom
            rotation = self.rotations[geom]
            points = seen[mask]
            local = (points - self.positions[geom]) @ rotation
            if geom in later.height_maps and (image.target[mask] >= 0).all():
                height_map = later.height_maps[geom]
                page = ChartPage(len(height_map), height_map.shape[1] - 2)
                places = page.locate(image.place[mask].astype(np.float64))
                heights = spline_heights(height_map, *spline_samples(*places, page.resolution))
                direction = image.smooth_normal[mask] @ rotation
                still = local - image.height[mask, None] * direction
                mesh = self.meshes[geom]
                V = later.meshes[geom][0]
                # the mesh has moved on, and takes points and directions along
                if not np.array_equal(mesh[0], V):
                    taken = MovingVertices(*mesh, still, direction, direction)(V)
                    still, direction = (each.astype(np.float64) for each in taken[:2])
                local = still + heights[:, None] * direction
            flow[mask] = later.pixels(
                local @ later.rotations[geom].T + later.positions[geom]
            ) - self.pixels(points)
        return flow


def passes_of(
    sighting: Sighting, later: Sighting | None, names: tuple[str, ...]
) -> dict[str, NDArray]:
    """The passes of a frame, by name; `later` is the next frame's sighting, without which nothing flows."""
    image = sighting.image
    makers = {
        "depth": lambda: np.where(image.depth > 0, image.depth, np.float32(np.inf)),
        "normal": lambda: image.normal,
        "segmentation": lambda: (image.geom + 1).astype(np.uint32),
        "flow": lambda: (
            np.zeros((*image.depth.shape, 2), np.float32)
            if later is None
            else sighting.flow_to(later)
        ),
        "position": lambda: sighting.positions_seen.astype(np.float32),
        "height": lambda: image.height,
    }
    return {name: np.ascontiguousarray(makers[name]()) for name in names}


class Sensor:
    """Averages images in linear light.

    Images are uint8, in sRGB, with a fourth channel for their opacity, by which the colours are
    weighted; or float16, in linear light, with colours already multiplied by their opacity.

    Parameters
    ----------
    factor : int
        Blocks of factor by factor pixels become one.
    exposures : int
        Images that make up a frame.
    """

    def __init__(self, factor: int = 1, exposures: int = 1) -> None:
        self._factor = factor
        self._exposures = exposures
        self._count = 0
        self._light = np.zeros((0, 0, 4), np.float32)  # sums: light times opacity, opacity

    def expose(self, image: NDArray) -> NDArray | None:
        """Take in an image.

        Parameters
        ----------
        image : uint8 or float16 [factor height, factor width, 3 or 4]
            The same shape and kind for all exposures of a frame.

        Returns
        -------
        uint8 or float16 [height, width, 3 or 4]
            The frame after its last exposure; None before.
        """
        if self._factor == self._exposures == 1:
            return image
        factor = self._factor
        (height, width, channels) = image.shape
        if self._count == 0:
            self._light = np.zeros((height // factor, width // factor, 4), np.float32)
        if image.dtype == np.uint8:
            _gather_codes(image, factor, _LINEAR, self._light)
        else:
            blocks = image.reshape(height // factor, factor, width // factor, factor, channels)
            self._light[..., :channels] += blocks.sum(axis=(1, 3), dtype=np.float32)
        self._count = (self._count + 1) % self._exposures
        if self._count:
            return None
        most = factor * factor * self._exposures
        if image.dtype != np.uint8:
            return (self._light[..., :channels] / most).astype(image.dtype)
        frame = np.empty((*self._light.shape[:2], channels), np.uint8)
        _encode(self._light, most, _SRGB, frame)
        return frame


@kernel
def _gather_codes(image: NDArray[np.uint8], factor: int, linear: Floats32, light: Floats32) -> None:
    """Add an image's blocks, in linear light, to the sums `light` [height, width, 4]: light times opacity, opacity."""
    opaque = image.shape[2] == 3
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            red = green = blue = opacity = np.float32(0)
            for i in range(factor * row, factor * (row + 1)):
                for j in range(factor * column, factor * (column + 1)):
                    weight = np.float32(1) if opaque else np.float32(image[i, j, 3])
                    red += weight * linear[image[i, j, 0]]
                    green += weight * linear[image[i, j, 1]]
                    blue += weight * linear[image[i, j, 2]]
                    opacity += weight
            light[row, column, 0] += red
            light[row, column, 1] += green
            light[row, column, 2] += blue
            light[row, column, 3] += opacity


@kernel
def _encode(light: Floats32, most: int, srgb: NDArray[np.uint8], frame: NDArray[np.uint8]) -> None:
    """Means of the sums `light` of `most` values each, as sRGB codes with straight opacity."""
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            opacity = light[row, column, 3]
            scale = (len(srgb) - 1) / opacity if opacity > 0 else np.float32(0)
            for channel in range(3):
                frame[row, column, channel] = srgb[int(light[row, column, channel] * scale + 0.5)]
            if frame.shape[2] == 4:
                frame[row, column, 3] = int(opacity / most + 0.5)


def surface_of(
    waves: WaveSolver, look: str, color: tuple[float, float, float] | None = None
) -> Surface:
    """Surface to be drawn of a target."""
    atlas = drawn = waves.rest
    if isinstance(atlas, SphereAtlas) and atlas.resolution > _SPHERE:
        drawn = sphere_atlas(atlas.radius, _SPHERE)
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


def viewpoint(
    model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, time: float
) -> Camera | FixedCamera:
    """Camera of a scene at a time [s].

    A camera named in the MJCF is taken as it stands in `data` (it may ride on a body). Otherwise
    MuJoCo's free camera, aimed at the model's middle where the scene says nothing else. With
    `orbit` either circles by that many degrees a second; with `track` the free camera moves along
    with a body's centre of mass, and the named one turns towards it.
    """
    tracked = None if entry.track is None else data.subtree_com[model.body(entry.track).id]
    if entry.name is not None:
        fixed = Camera.from_mjcf(model, data, entry.name)
        if tracked is not None:
            fixed = _aimed(fixed, tracked)
        if not entry.orbit:
            return fixed
        angle = np.radians(entry.orbit) * time  # around the vertical through its aim
        turn = np.array(
            [
                [np.cos(angle), -np.sin(angle), 0.0],
                [np.sin(angle), np.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        focus = fixed.pose().focus
        position = focus + turn @ (fixed.position - focus)
        return dataclasses.replace(fixed, position=position, rotation=turn @ fixed.rotation)
    base = np.zeros(3) if tracked is not None else model.stat.center
    aim = base if entry.lookat is None else entry.lookat
    x, y, z = (float(value) for value in (aim if tracked is None else tracked + aim))
    return Camera(
        lookat=(x, y, z),
        distance=entry.distance if entry.distance is not None else 1.5 * float(model.stat.extent),
        azimuth=entry.azimuth + entry.orbit * time,
        elevation=entry.elevation,
        fovy=entry.fovy,
    )


def focal_distance(
    model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, pose: Pose
) -> float:
    """Distance of the plane in focus from a scene's camera, along its axis [m]."""
    if entry.focus is None:
        return pose.distance
    if isinstance(entry.focus, float):
        return entry.focus
    if isinstance(entry.focus, str):
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, entry.focus)
        point = data.subtree_com[body] if body >= 0 else data.geom_xpos[model.geom(entry.focus).id]
    else:
        point = np.array(entry.focus)
    return max(float((pose.position - point) @ pose.rotation[:, 2]), _NEAREST * pose.distance)


def _aimed(camera: FixedCamera, target: NDArray[np.float64]) -> FixedCamera:
    """The camera turned in place, upright, towards a point [m]."""
    back = camera.position - target
    distance = float(np.linalg.norm(back))
    right = np.cross([0.0, 0.0, 1.0], back)
    if distance == 0 or not right.any():  # at the point itself, or exactly above or below it
        return camera
    right /= np.linalg.norm(right)
    back = back / distance
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    return dataclasses.replace(camera, rotation=rotation, distance=distance)


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
        How high the waves were.
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
        self._sensor = Sensor(supersample, len(self._lens_points))
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
        """Render an exposure; return the frame after its last, [height, width, 3], or 4 if it is transparent."""
        self.submit(snapshot)
        return self.fetch()

    def submit(self, snapshot: Snapshot) -> None:
        """Draw a snapshot without waiting for it: `fetch` returns it, after those submitted before."""
        height_maps = {
            self._geoms[name]: height_map for name, height_map in snapshot.height_maps.items()
        }
        pose = self.camera(snapshot).pose()
        lens = self._lens_points[snapshot.exposure]
        sim = self._simulation
        self.shown.look(snapshot.data, snapshot.heights, pose)
        if lens.any():
            focus = focal_distance(sim.model, snapshot.data, sim.scene.camera, pose)
            pose = dataclasses.replace(pose, lens=tuple(lens), focal_distance=focus)
        self.renderer.submit(snapshot.data, height_maps, pose, snapshot.exposure)

    def fetch(self) -> NDArray | None:
        """Wait for the earliest snapshot submitted, and return what `render` does."""
        return self._sensor.expose(self.renderer.fetch())

    def sighting(self, snapshot: Snapshot) -> Sighting:
        """What the camera sees at a snapshot, through the middle of its lens."""
        height_maps = {
            self._geoms[name]: height_map for name, height_map in snapshot.height_maps.items()
        }
        camera = self.camera(snapshot)
        image = self.renderer.surfaces(
            snapshot.data, height_maps, camera, (self.width, self.height)
        )
        read = {}
        meshes = {}
        for name, geom in self._geoms.items():
            mesh = self._simulation.ripples[name].rest.mesh
            height_map = height_maps[geom]
            read[geom] = np.asarray(height_map)
            meshes[geom] = (
                height_map.V if isinstance(height_map, MovedHeightMap) else mesh.V,
                mesh.F,
            )
        data = snapshot.data
        model = self._simulation.model
        more = first_skin(model) + model.nskin - model.ngeom  # what is soft is in the world
        positions = np.concatenate([data.geom_xpos, np.zeros((more, 3))])
        rotations = np.concatenate(
            [data.geom_xmat.reshape(-1, 3, 3), np.tile(np.eye(3), (more, 1, 1))]
        )
        return Sighting(image, camera.pose(), positions, rotations, read, meshes)

    def camera(self, snapshot: Snapshot) -> Camera | FixedCamera:
        """Camera of a snapshot, through the middle of its lens."""
        sim = self._simulation
        return viewpoint(sim.model, snapshot.data, sim.scene.camera, snapshot.data.time)
