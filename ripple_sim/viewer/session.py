"""`Session`: a running scene that the user can poke and change, without a window.

It finds the rippling surface under a ray, and has the triangles that are drawn of each.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.coupling.soft import target_pose
from ripple_sim.export.moving_mesh import Displaced, MovingMesh
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver import RippleError
from ripple_sim.solver.mesh.queries import RayScene

from .opening import FLIGHT, Balls, poke_strength, surface_size

# Software OpenGL draws this many triangles 30 times a second beside the simulation, on two cores.
MAX_TRIANGLES = 24_000

OPERATORS = ("fem", "uncorrected", "paper")
# Coefficients of the material that the user can change, with their units.
SLIDERS = {"speed": "m/s", "damping": "1/s", "stiffness": "1/s²"}

# The range of the colours grows with the waves at once, and shrinks by this factor per frame at
# most.
_RANGE_DECAY = 0.96
# End of the colours over the greatest height: at a contact the surface is deeper than its waves are
# high.
_RANGE_SHARE = 0.25
# Least range of the colours over the surface's size, so that rounding errors are not visible.
_MIN_RANGE = 1e-4


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
    has_skins : bool
        Whether `meshes` and `skins` are made, which a window draws.

    Attributes
    ----------
    meshes : dict
        `MovingMesh` of each rippling geom, by name: triangles of about its texels.
    skins : dict
        Likewise, its points, normals and heights as of the latest frame, see `Displaced`.
    poke_radius, poke_impulse : float
        Of a poke [m] and [N s].
    paused : bool
    operator : str
        The wave operator, one of `OPERATORS`.
    color_range : float
        Height at the end of the colours [m].
    size : float
        Longest extent of the smallest rippling surface [m].
    """

    def __init__(
        self,
        scene: Scene,
        *,
        fps: int = 30,
        resolution: int | None = None,
        has_skins: bool = True,
    ) -> None:
        adopt_warnings()
        self.fps = fps
        self.simulation = Simulation(
            scene,
            fps=fps,
            resolution=resolution,
            backend="cpu",
            on_step=lambda now: self._balls.hold(now.data),
        )
        self._balls = Balls(self.simulation.model)
        self._material: dict[str, float] = {}
        ripples = self.simulation.ripples
        limited = self.simulation.limited
        self.meshes = {
            name: MovingMesh(ripples[name].rest, limit=limited[name], triangles=MAX_TRIANGLES)
            for name in (ripples if has_skins else ())
        }
        self.skins: dict[str, Displaced] = {}
        # for rays, with their vertices
        self._scenes: dict[str, tuple[NDArray[np.float64] | None, RayScene]] = {}
        self.size = surface_size(scene)
        material = ripples[scene.targets[0].geom].material
        self.poke_radius, self.poke_impulse = poke_strength(material, self.size)
        self.operator = OPERATORS[0]
        self.paused = False
        self.color_range = 0.0
        self.refresh()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.simulation.data.time)

    @property
    def parked(self) -> set[int]:
        """Geoms of the balls not thrown yet."""
        return {self._balls.geoms[i] for i in self._balls.parked}

    def material(self, name: str) -> float:
        """A coefficient of the first surface's material, one of `SLIDERS`.

        If it is a map, its largest value is returned.
        """
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
        ripples = self.simulation.ripples
        color_range = _MIN_RANGE * self.size
        for name, mesh in self.meshes.items():
            V = ripples.vertices(name, self.simulation.data)
            waves = ripples[name]
            shape = mesh.shape(waves.height, waves.velocity, V)
            self.skins[name] = shape
            color_range = max(color_range, _RANGE_SHARE * float(np.abs(shape.height).max()))
        self.color_range = max(color_range, _RANGE_DECAY * self.color_range)

    def reset(self) -> None:
        """Restart from the beginning; the chosen material and operator stay."""
        self._balls.park()
        self.simulation.reset()
        if self._material:
            self.set_material(**self._material)
        self.color_range = 0.0
        self.refresh()

    def set_operator(self, operator: str) -> None:
        """Switch the wave operator on all surfaces; the waves stay as they are.

        Raises `SolverError` for an unknown operator.
        """
        self.simulation.ripples.change_operator(operator)
        self.operator = operator

    def set_material(self, **coefficients: Any) -> None:
        """Change coefficients of all surfaces' material; the waves stay as they are.

        Raises `SolverError` for an invalid coefficient.
        """
        for name in self.simulation.ripples:
            self.simulation.ripples.change_material(name, **coefficients)
        self._material.update(coefficients)

    def pick(
        self, origin: ArrayLike, direction: ArrayLike
    ) -> tuple[str, NDArray[np.float64], float] | None:
        """Find where a ray from a point [m] in the world first meets a rippling surface.

        The surfaces are taken without their displacement. None if the ray meets no surface.

        Returns the name of the geom, the point in its frame [m], and the distance in lengths of the
        direction.
        """
        start = np.asarray(origin, dtype=np.float64)
        along = np.asarray(direction, dtype=np.float64)
        hits = []
        for name in self.simulation.ripples:
            position, rotation = self._pose(name)
            local = (start - position) @ rotation
            heading = along @ rotation
            waves = self.simulation.ripples[name]
            V, scene = self._scenes.get(name, (None, None))
            if scene is None or waves.vertices is not V:
                scene = RayScene(waves.atlas.mesh.V, waves.atlas.mesh.F)
                self._scenes[name] = waves.vertices, scene
            triangle, far, _, _ = scene.cast(local[None], heading[None])
            if triangle[0] >= 0:
                distance = float(far[0])
                hits.append((name, local + distance * heading, distance))
        return min(hits, key=lambda hit: hit[2], default=None)

    def poke(self, origin: ArrayLike, direction: ArrayLike) -> NDArray[np.float64] | None:
        """Poke the first surface on a ray with `poke_impulse`.

        Returns the point in the surface's frame [m], or None if the ray meets no surface.
        """
        hit = self.pick(origin, direction)
        if hit is None:
            return None
        name, point, _ = hit
        self.simulation.ripples[name].add_impulse(point, self.poke_impulse, self.poke_radius)
        return point

    def throw(self, origin: ArrayLike, direction: ArrayLike) -> bool:
        """Throw a ball from a point [m] in the world along a direction.

        It comes down where the ray meets a surface.

        Beside the surface it flies through the point of the ray that is nearest to the first
        surface's middle. Returns whether there was a ball.
        """
        start = np.asarray(origin, dtype=np.float64)
        along = np.asarray(direction, dtype=np.float64)
        hit = self.pick(start, along)
        middle, _ = self._pose(self.simulation.scene.targets[0].geom)
        reach = (
            max(float((middle - start) @ along / (along @ along)), 0.0) if hit is None else hit[2]
        )
        return self._balls.throw(self.simulation.data, start, start + reach * along, FLIGHT)

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position [m] and rotation matrix of a geom in the world."""
        return target_pose(self.simulation.data, self.simulation.ripples.geom_ids[name])
