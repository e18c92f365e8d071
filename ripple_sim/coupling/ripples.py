"""From contact forces to waves: `Ripples` adds rippling surfaces to anybody's MuJoCo loop."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver import Material, SolverError, WaveSolver
from ripple_sim.solver.atlas.cubemap import face_coordinates
from ripple_sim.solver.waves.footprint import footprint

from ..errors import RippleWarning, SceneError
from .collidable import collides_as_hull, hull_warning
from .contacts import ContactPair, contact_pairs
from .patch import pressed_patch
from .press import Press
from .pushback import PushBack
from .speeds import SpeedCheck
from .target import find_target, geom_name, target_atlas

# Footprint radius over the touching body's smallest half-extent: about the patch of a ball sunk in by an eighth.
_FOOTPRINT = 0.5

_NOT_CONVEX = (int(mujoco.mjtGeom.mjGEOM_SDF), int(mujoco.mjtGeom.mjGEOM_HFIELD))


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
    two_way : bool
        Let the moving surfaces push back on the bodies that touch them, through `data.xfrc_applied`. What others have
        put there stays, as long as they add to it or set it before `step`.

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
        two_way: bool = False,
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
        self._presses: dict[tuple[int, int], Press] = {}
        self._push_back = PushBack(model) if two_way else None
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
        """Let the contact forces of the physics step just made press on the surfaces; advance the waves to `data.time`.

        The forces and poses in `data` after `mj_step` are those at the beginning of that step, over which MuJoCo holds
        the forces: each contact gives normal force times time step. If time has gone backwards (the simulation was
        reset) the waves are reset too; if it stands still, nothing happens.
        """
        timestep = self.model.opt.timestep
        elapsed = timestep if self._time is None else data.time - self._time
        if elapsed < 0:
            self.reset()
            elapsed = timestep
        self._time = data.time
        self.last_impulses = []
        if elapsed == 0:
            return
        self._check_speeds(data)
        loads: dict[int, list[tuple[NDArray[np.int64], NDArray[np.float64]]]] = {geom: [] for geom in self._waves}
        if self._push_back is not None:
            for geom, held in self._push_back.withdraw(data).items():
                loads[geom] += held
        touching = {(pair.target, pair.other): pair for pair in contact_pairs(self.model, data, set(self._waves))}
        for pair in touching.values():
            loads[pair.target].append(self._press(data, pair, timestep, elapsed))
        for key, press in list(self._presses.items()):
            if key not in touching:
                loads[key[0]].append(press.release(elapsed))
                if press.over:
                    del self._presses[key]
        for geom, waves in self._waves.items():
            _advance(waves, loads[geom], elapsed)
        if self._push_back is not None:
            self._push_back.apply(
                data,
                [(pair, self._waves[pair.target], self._presses[key].spread) for key, pair in touching.items()],
            )

    def reset(self) -> None:
        """Flatten all surfaces."""
        self._time = None
        self.last_impulses = []
        self._presses.clear()
        if self._push_back is not None:
            self._push_back.forget()
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

    def change_operator(self, operator: str) -> None:
        """Take another wave operator on all surfaces, by its name in `WaveSolver`; height and velocity stay.

        Raises
        ------
        SolverError
            For an unknown operator.
        """
        before = self._options
        self._options = {**before, "operator": operator}
        try:
            for name in self:
                self._rebuild(name)
        except SolverError:
            self._options = before
            raise

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
            # a region that nothing pulls on takes up nothing, and without viscosity nothing drags it along either
            coefficients = ("speed", "stiffness", "bending", "viscosity")
            material = dataclasses.replace(
                material,
                **{name: material.texels(name, n) * moves for name in coefficients if np.any(getattr(material, name))},
            )
        new = WaveSolver(old.atlas, material, **self._options)
        new.height, new.velocity, new.pressure = old.height, old.velocity, old.pressure
        new.time, new.substeps_taken = old.time, old.substeps_taken
        self._waves[self._geoms[name]] = new
        self._presses = {key: press for key, press in self._presses.items() if key[0] != self._geoms[name]}

    def _warn_of_hull(self, name: str) -> None:
        if collides_as_hull(self.model, self._geoms[name]):
            message = hull_warning(name, self[name].atlas)
            if message is not None:
                warnings.warn(message, RippleWarning, stacklevel=3)

    def _press(
        self, data: mujoco.MjData, pair: ContactPair, timestep: float, elapsed: float
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Forces [N] of a pair on the texels of its target, over the time that has elapsed."""
        waves = self._waves[pair.target]
        position, rotation = data.geom_xpos[pair.target], data.geom_xmat[pair.target].reshape(3, 3)
        local, total = (pair.points - position) @ rotation, float(pair.forces.sum())
        surface, direction = waves.atlas.project(pair.forces @ local / total)
        n = waves.atlas.resolution
        face, *inside = (float(x[0]) for x in face_coordinates(direction, n))
        row, column = (int(np.clip(np.rint(x), 0, n - 1)) for x in inside)
        self.last_impulses.append(
            Impulse(
                geom=geom_name(self.model, pair.target),
                other=geom_name(self.model, pair.other),
                point=position + rotation @ surface[0],
                impulse=total * timestep,
                texel=(int(face), row, column),
            )
        )
        radius = _FOOTPRINT * min(self._extent(pair.target), self._extent(pair.other))
        convex = self.model.geom_type[pair.other] not in _NOT_CONVEX
        points, forces, radius = pressed_patch(waves.atlas, local, pair.forces, radius, convex)
        key = pair.target, pair.other
        press = self._presses.get(key) or self._presses.setdefault(key, Press(waves))
        return press.press(points, forces * (timestep / elapsed), radius, elapsed)

    def _extent(self, geom: int) -> float:
        """Smallest half-extent of a geom [m]; planes and height fields have none, and count as endless."""
        if self.model.geom_type[geom] in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD):
            return np.inf
        return float(self.model.geom_aabb[geom, 3:].min())


def _advance(waves: WaveSolver, loads: list[tuple[NDArray[np.int64], NDArray[np.float64]]], dt: float) -> None:
    """Take a step under forces [N, positive inwards] beside those that the surface holds of its own."""
    held = waves._load
    if loads:
        texels, forces = (np.concatenate(column) for column in zip(*loads, strict=True))
        waves._load = held.plus(texels, -forces)
    try:
        waves.step(dt)
    finally:
        if loads:
            waves._load, held.uploaded = held, False
