"""`Session`: a running scene that the user can poke and change, without a window.

Which rippling surface lies under a ray.

The skin of a target: a fine triangle mesh whose points and normals follow the waves, changed in place.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.soft import target_pose
from ripple_sim.coupling.stepping import adopt_warnings
from ripple_sim.render.surfaces.moving import MovingSurface
from ripple_sim.render.surfaces.surface import Charts
from ripple_sim.render.surfaces.vertices import COORDINATES, DIRECTION, NORMAL, POSITION, tessellated
from ripple_sim.render.visuals.corners import smooth_normals
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver import Atlas, HeightMap, RippleError
from ripple_sim.solver.kernel import Floats32, Ints32, kernel
from ripple_sim.solver.mesh.rays import RayScene

from .opening import FLIGHT, Balls, poke_strength, surface_size


@dataclasses.dataclass(frozen=True, eq=False)
class Hit:
    """Where a ray meets a rippling surface.

    Attributes
    ----------
    geom : str
    point : float64 [3]
        In the frame of the geom [m].
    distance : float
        From the ray's origin, in lengths of its direction.
    """

    geom: str
    point: NDArray[np.float64]
    distance: float


class Picker:
    """Casts rays at the undisplaced targets of a simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._scenes: dict[str, tuple[NDArray[np.float64] | None, RayScene]] = {
            name: (None, _ray_scene(simulation, name)) for name in simulation.ripples
        }

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> Hit | None:
        """Nearest point of a target on a ray from a point [m] of the world, or None."""
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        hits = []
        for name in self._scenes:
            scene = self._scene(name)
            position, rotation = self._pose(name)
            local, heading = (start - position) @ rotation, along @ rotation
            found = scene.cast(local[None], heading[None])
            if found.triangle[0] >= 0:
                distance = float(found.distance[0])
                hits.append(Hit(name, local + distance * heading, distance))
        return min(hits, key=lambda hit: hit.distance, default=None)

    def reach(self, origin: ArrayLike, direction: ArrayLike) -> float:
        """How far along a ray a target is met, or passed most closely by its first one's middle, in its lengths."""
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        hit = self.pick(start, along)
        if hit is not None:
            return hit.distance
        middle, _ = self._pose(self._simulation.scene.targets[0].geom)
        return max(float((middle - start) @ along / (along @ along)), 0.0)

    def _scene(self, name: str) -> RayScene:
        """A target's surface where it is."""
        V, scene = self._scenes[name]
        if self._simulation.ripples[name].vertices is not V:
            scene = _ray_scene(self._simulation, name)
            self._scenes[name] = self._simulation.ripples[name].vertices, scene
        return scene

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position [m] and rotation matrix of a geom in the world."""
        return target_pose(self._simulation.data, self._simulation.ripples.geom_ids[name])


def _ray_scene(simulation: Simulation, name: str) -> RayScene:
    mesh = simulation.ripples[name].atlas.mesh
    return RayScene(mesh.V, mesh.F)


# Software OpenGL draws this many triangles 30 times a second beside the simulation, on two cores.
MAX_TRIANGLES = 24_000


class Skin:
    """A surface, tessellated to about its texels and displaced by their heights.

    Parameters
    ----------
    atlas : Atlas
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.

    Attributes
    ----------
    F : int64 [m, 3]
        Triangles, counter-clockwise from outside.
    points : float32 [n, 3]
        Displaced vertices in the frame of the mesh [m].
    normals : float32 [n, 3]
        Unit normals of the displaced surface; creases of the mesh stay sharp.
    height : float32 [n]
        [m].
    """

    def __init__(self, atlas: Atlas, limit: bool = True) -> None:
        mesh, charts = atlas.mesh, Charts.of(atlas)
        self.F, vertices, _ = tessellated(
            mesh,
            charts,
            smooth=smooth_normals(mesh.V, mesh.F),
            max_length=float(np.sqrt(atlas.areas.mean())),
            max_faces=MAX_TRIANGLES,
        )
        for columns in (DIRECTION, NORMAL):  # those of midpoints are means
            vertices[:, columns] /= np.linalg.norm(vertices[:, columns], axis=1, keepdims=True)
        rest, direction, normals = (
            np.ascontiguousarray(vertices[:, columns], dtype=np.float32) for columns in (POSITION, DIRECTION, NORMAL)
        )
        chart_points = charts.map.chart_points(vertices[:, COORDINATES], atlas.resolution)
        self._rest = _Rest(rest, direction, normals, *_bilinear(*chart_points, atlas.resolution))
        self._height_map = HeightMap.drawn(atlas, limit)
        self._moving = MovingSurface(atlas, rest, direction, normals)
        self.points, self.normals = rest.copy(), normals.copy()
        self.height = np.zeros(len(vertices), np.float32)

    def update(self, height: NDArray[np.float32], V: NDArray[np.float64] | None = None) -> None:
        """Follow a height field, float32 [C, n, n], and the vertices of the mesh, [vertex_count, 3], in metres."""
        height_map, rest = self._height_map(height), self._rest
        if V is not None:
            height_map, (points, directions, normals) = self._moving(height_map, V)
            rest = rest._replace(points=points, directions=directions, normals=normals)
        _displace(height_map.reshape(-1, 4), rest, self.points, self.normals, self.height)


def _bilinear(
    chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64], n: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Addresses in a height map [C (n + 2)^2] and weights of the four texels round each chart point, [k, 4] both."""
    # the height map has a halo around each chart
    row, column = np.clip(row + 1, 0, n + 1), np.clip(column + 1, 0, n + 1)
    r, c = np.minimum(row.astype(np.int64), n), np.minimum(column.astype(np.int64), n)
    s, t = row - r, column - c
    corner = (chart * (n + 2) + r) * (n + 2) + c
    texels = np.stack([corner, corner + 1, corner + n + 2, corner + n + 3], axis=1)
    weights = np.stack([(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t], axis=1)
    return texels.astype(np.int32), weights.astype(np.float32)


class _Rest(NamedTuple):
    """The undisplaced skin: points and outward directions and normals [n, 3], and where each point lies on the texels.

    `texels` and `weights` [n, 4] are addresses in a height map [C (n + 2)^2] and bilinear weights.
    """

    points: Floats32
    directions: Floats32
    normals: Floats32
    texels: Ints32
    weights: Floats32


@kernel
def _displace(height_map: Floats32, rest: _Rest, points: Floats32, normals: Floats32, height: Floats32) -> None:
    """Raise points by the height; a normal tips against the gradient, to first order in the height."""
    texels, weights, direction, rest_normals = rest.texels, rest.weights, rest.directions, rest.normals
    for i in range(len(texels)):
        gx = gy = gz = h = np.float32(0)
        for k in range(4):
            weight, texel = weights[i, k], texels[i, k]
            gx += weight * height_map[texel, 0]
            gy += weight * height_map[texel, 1]
            gz += weight * height_map[texel, 2]
            h += weight * height_map[texel, 3]
        height[i] = h
        for k in range(3):
            points[i, k] = rest.points[i, k] + h * direction[i, k]
        x, y, z = rest_normals[i, 0] - gx, rest_normals[i, 1] - gy, rest_normals[i, 2] - gz
        scale = 1 / np.sqrt(x * x + y * y + z * z)
        normals[i, 0], normals[i, 1], normals[i, 2] = x * scale, y * scale, z * scale


OPERATORS = ("fem", "uncorrected", "paper")
# Coefficients of the material that the user can change, with their units.
SLIDERS = {"speed": "m/s", "damping": "1/s", "stiffness": "1/s²"}

# The range of the colours follows the waves: at once as they grow, by this factor per frame as they fade.
_FADE = 0.96
# Colours end at this share of the greatest height: at a contact the surface is higher than its waves.
_FULL = 0.25
# Least range of the colours over the surface's size, so that rounding noise is not shown.
_FAINT = 1e-4


class Session:
    """A running scene: advances frame by frame, pauses, restarts, takes pokes and thrown balls.

    Parameters
    ----------
    scene : Scene
        From `open_scene`; any other scene has no balls to throw.
    fps : int
        Frames a second of simulated time.
    resolution : int, optional
        Overrides the scene's atlas resolutions.

    Attributes
    ----------
    skins : dict
        `Skin` of each rippling geom, by name, as of the latest frame.
    poke_impulse : float
        Of a poke [N s].
    paused : bool
    operator : str
        The wave operator, one of `OPERATORS`.
    color_range : float
        Height at the end of the colours [m].
    """

    def __init__(self, scene: Scene, *, fps: int = 30, resolution: int | None = None) -> None:
        adopt_warnings()
        self.fps = fps
        self.simulation = Simulation(scene, fps=fps, resolution=resolution, backend="cpu", on_step=self._before_step)
        self._balls = Balls(self.simulation.model)
        self._material: dict[str, float] = {}
        ripples, limited = self.simulation.ripples, self.simulation.limited
        self.skins = {name: Skin(ripples[name].rest, limited[name]) for name in ripples}
        self._picker = Picker(self.simulation)
        self._size = surface_size(scene)
        self._strength = poke_strength(ripples[scene.targets[0].geom].material, self._size)
        self.poke_impulse = self._strength.impulse
        self.operator = OPERATORS[0]
        self.paused = False
        self.color_range = _FAINT * self._size

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.simulation.data.time)

    @property
    def size(self) -> float:
        """Longest extent of the smallest rippling surface [m]."""
        return self._size

    @property
    def parked(self) -> set[int]:
        """Geoms of the balls not thrown yet."""
        return {self._balls.geoms[i] for i in self._balls.parked}

    def material(self, name: str) -> float:
        """Coefficient of the first surface's material, one of `SLIDERS`; where it is a map, its largest value."""
        waves = self.simulation.ripples[self.simulation.scene.targets[0].geom]
        return self._material.get(name, float(np.max(getattr(waves.material, name))))

    def advance(self) -> bool:
        """Advance by one frame, unless paused; return whether anything moved.

        Raises
        ------
        RippleError
            If physics or waves have become unstable. The session is paused then, and can be reset.
        """
        if not self.paused:
            self.step()
        return not self.paused

    def step(self) -> None:
        """Advance by one frame, paused or not. Raises as `advance` does."""
        try:
            self.simulation.advance_frame()
            self.refresh()
        except RippleError:
            self.paused = True
            raise

    def refresh(self) -> None:
        """Bring the skins and the range of the colours up to date."""
        wanted = _FAINT * self._size
        for name, skin in self.skins.items():
            ripples = self.simulation.ripples
            skin.update(ripples[name].height, ripples.vertices(name, self.simulation.data))
            wanted = max(wanted, _FULL * float(np.abs(skin.height).max()))
        self.color_range = max(wanted, _FADE * self.color_range)

    def reset(self) -> None:
        """Restart from the beginning; the chosen material and operator stay."""
        self._balls.park()
        self.simulation.reset()
        if self._material:
            self._change_material(**self._material)
        self.color_range = 0.0
        self.refresh()

    def set_operator(self, operator: str) -> None:
        """Switch the wave operator on all surfaces; the waves stay as they are.

        Raises
        ------
        SolverError
            For an unknown operator.
        """
        self.simulation.ripples.change_operator(operator)
        self.operator = operator

    def set_material(self, **coefficients: float) -> None:
        """Change coefficients of all surfaces' material; the waves stay as they are.

        Raises
        ------
        SolverError
            For an invalid coefficient.
        """
        self._change_material(**coefficients)
        self._material.update(coefficients)

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> Hit | None:
        """Nearest point of an undisplaced rippling surface on a ray from a point [m] of the world, or None."""
        return self._picker.pick(origin, direction)

    def poke(self, origin: ArrayLike, direction: ArrayLike) -> Hit | None:
        """Press on the first surface on a ray, with `poke_impulse`; return the place, if there is one."""
        hit = self.pick(origin, direction)
        if hit is not None:
            self.simulation.ripples[hit.geom].add_impulse(hit.point, self.poke_impulse, self._strength.radius)
        return hit

    def throw(self, origin: ArrayLike, direction: ArrayLike) -> bool:
        """Throw a ball from a point [m] of the world along a direction; it comes down where that meets a surface.

        Beside the surface it flies through the point of the ray that is nearest to the first surface's middle. Returns
        whether there was a ball.
        """
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        through = start + self._picker.reach(start, along) * along
        return self._balls.throw(self.simulation.data, start, through, FLIGHT)

    def _before_step(self, simulation: Simulation) -> None:
        self._balls.hold(simulation.data)

    def _change_material(self, **coefficients: Any) -> None:
        for name in self.simulation.ripples:
            self.simulation.ripples.change_material(name, **coefficients)
