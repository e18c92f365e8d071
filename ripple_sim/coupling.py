"""From contact forces to waves: `Ripples` adds rippling surfaces to anybody's MuJoCo loop."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver import Material, WaveSolver
from ripple_sim.solver.footprint import footprint

from .collidable import collides_as_hull, hull_warning
from .contacts import ContactPair, cluster, contact_pairs
from .errors import RippleWarning, SceneError
from .speeds import SpeedCheck
from .target import find_target, geom_name, target_atlas

# Footprint radius over the touching body's smallest half-extent: about the patch of a ball sunk in by an eighth.
_FOOTPRINT = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """What one body gave to one target in one physics step.

    Attributes
    ----------
    geom, other : str
        Names of the target and of the touching geom.
    point : float64 [3]
        Force-weighted contact point on the target's true surface, in the world [m].
    impulse : float
        Sum of normal force times time step [N s], not negative; it presses inwards.
    texel : tuple of int
        Face, row and column of the texel nearest to the point.
    """

    geom: str
    other: str
    point: NDArray[np.float64]
    impulse: float
    texel: tuple[int, int, int]


class Ripples:
    """Ripples on geoms of a MuJoCo model, driven by its contact forces.

    Call `step(data)` after each `mujoco.mj_step(model, data)`.

    Parameters
    ----------
    model : mujoco.MjModel
    materials : mapping
        Geom name to its `Material`. Geoms of type mesh, sdf, sphere, ellipsoid, capsule, cylinder and box can ripple.
        Note that MuJoCo collides a mesh geom as its convex hull; type="sdf" collides as the true surface.
    resolution : int or mapping
        Texels along an edge of the atlas's faces, for all targets or by geom name.
    backend, operator, conserve_volume
        As for `WaveSolver`.

    Raises
    ------
    SceneError
        For an unknown geom or one that cannot ripple.
    RippleError
        If a geom's mesh is not a closed genus-0 surface, or a wave parameter is invalid.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        materials: Mapping[str, Material],
        *,
        resolution: int | Mapping[str, int] = 128,
        backend: str = "auto",
        operator: str = "fem",
        conserve_volume: bool = True,
    ) -> None:
        self.model = model
        self._geoms = {name: find_target(model, name) for name in materials}
        self._materials = dict(materials)
        self._rigid: dict[str, NDArray[np.bool_]] = {}
        self._options: dict[str, Any] = {
            "backend": backend,
            "operator": operator,
            "conserve_volume": conserve_volume,
        }
        self._waves: dict[int, WaveSolver] = {}
        for name, geom in self._geoms.items():
            n = resolution[name] if isinstance(resolution, Mapping) else resolution
            self._waves[geom] = WaveSolver(target_atlas(model, geom, n), materials[name], **self._options)
            self._warn_of_hull(name)
        self._check_speeds = SpeedCheck(model, list(self._waves))
        self._time: float | None = None
        self.last_impulses: list[Impulse] = []

    def __getitem__(self, name: str) -> WaveSolver:
        """Waves of a geom, by name."""
        if name not in self._geoms:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are {', '.join(map(repr, self._geoms))}"
            )
        return self._waves[self._geoms[name]]

    def __iter__(self) -> Iterator[str]:
        return iter(self._geoms)

    def __len__(self) -> int:
        return len(self._geoms)

    @property
    def geom_ids(self) -> dict[str, int]:
        """Geom id of every rippling geom, by name."""
        return dict(self._geoms)

    def step(self, data: mujoco.MjData) -> None:
        """Turn the contact forces of the physics step just made into impulses, and advance the waves up to `data.time`.

        The forces and poses in `data` after `mj_step` are those at the beginning of that step, over which MuJoCo holds
        the forces: each contact gives normal force times time step. If time has gone backwards (the simulation was
        reset) the waves are reset too.
        """
        timestep = self.model.opt.timestep
        elapsed = timestep if self._time is None else data.time - self._time
        if elapsed < 0:
            self.reset()
            elapsed = timestep
        self._time = data.time
        self._check_speeds(data)
        self.last_impulses = [
            self._press(data, pair, timestep) for pair in contact_pairs(self.model, data, set(self._waves))
        ]
        for waves in self._waves.values():
            waves.step(elapsed)

    def reset(self) -> None:
        """Flatten all surfaces."""
        self._time = None
        self.last_impulses = []
        for waves in self._waves.values():
            waves.reset()

    def change_material(self, name: str, **coefficients: Any) -> None:
        """Change coefficients of a geom's material, by their names in `Material`; height and velocity stay.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            For an invalid coefficient.
        """
        self[name]  # refuses unknown names
        self._materials[name] = dataclasses.replace(self._materials[name], **coefficients)
        self._rebuild(name)

    def make_rigid(self, name: str, point: ArrayLike, radius: float) -> None:
        """Let a disc of a geom's surface carry no waves: they go round it, and what hits it moves nothing.

        Parameters
        ----------
        name : str
            Geom.
        point : [3]
            In the frame of the geom [m]; the nearest surface point is taken.
        radius : float
            Along the surface [m].
        """
        atlas = self[name].atlas
        rigid = self._rigid.setdefault(name, np.zeros(atlas.areas.shape, bool))
        rigid.reshape(-1)[footprint(atlas, point, radius).texels] = True
        self._rebuild(name)

    def to_geom(self, name: str, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to that of the geom, which MuJoCo chooses for meshes."""
        geom = find_target(self.model, name)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self.model.geom_quat[geom])
        return (np.asarray(point, dtype=np.float64) - self.model.geom_pos[geom]) @ rotation.reshape(3, 3)

    def _rebuild(self, name: str) -> None:
        """Make a geom's solver anew for its changed material, in the state of the old one."""
        old, material = self[name], self._materials[name]
        if name in self._rigid:
            n, moves = old.atlas.resolution, ~self._rigid[name]
            # a region without tension and stiffness takes up nothing
            material = dataclasses.replace(
                material,
                speed=material.texels("speed", n) * moves,
                stiffness=material.texels("stiffness", n) * moves,
            )
        new = WaveSolver(old.atlas, material, **self._options)
        new.height, new.velocity, new.pressure = old.height, old.velocity, old.pressure
        new.time, new.substeps_taken = old.time, old.substeps_taken
        self._waves[self._geoms[name]] = new

    def _warn_of_hull(self, name: str) -> None:
        if collides_as_hull(self.model, self._geoms[name]):
            message = hull_warning(name, self[name].atlas)
            if message is not None:
                warnings.warn(message, RippleWarning, stacklevel=3)

    def _press(self, data: mujoco.MjData, pair: ContactPair, timestep: float) -> Impulse:
        waves = self._waves[pair.target]
        position, rotation = data.geom_xpos[pair.target], data.geom_xmat[pair.target].reshape(3, 3)
        local = (pair.points - position) @ rotation
        radius = _FOOTPRINT * self._extent(pair.other)
        for point, force in cluster(local, pair.forces, max(radius, 1e-9)):
            waves.add_impulse(point, force * timestep, radius)
        total = float(pair.forces.sum())
        surface, _ = waves.atlas.project(pair.forces @ local / total)
        n = waves.atlas.resolution
        face, row, column = np.unravel_index(int(waves.atlas.nearest_texel(surface)[0]), (6, n, n))
        return Impulse(
            geom=geom_name(self.model, pair.target),
            other=geom_name(self.model, pair.other),
            point=position + rotation @ surface[0],
            impulse=total * timestep,
            texel=(int(face), int(row), int(column)),
        )

    def _extent(self, geom: int) -> float:
        """Smallest half-extent of a geom [m]; 0 for planes and height fields, which have none."""
        if self.model.geom_type[geom] in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD):
            return 0.0
        return float(self.model.geom_aabb[geom, 3:].min())
