"""From contact forces to waves: `Ripples` adds rippling surfaces to anybody's MuJoCo loop."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.colliders.collidable import collides_as_hull, hull_warning, shell_warning
from ripple_sim.coupling.colliders.tunnelling import SpeedCheck
from ripple_sim.coupling.load.sources import Impulse, Sources
from ripple_sim.coupling.model.target import find_target, shells
from ripple_sim.coupling.two_way.push_back import PushBack
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.solver import Load, Material, WaveSolver

from .rippled_geom import RippleSurface

__all__ = ["Impulse", "Ripples"]


class Ripples:
    """Ripples on geoms of a MuJoCo model, driven by its contact forces.

    Call `step(data)` after each `mujoco.mj_step(model, data)`.

    Parameters
    ----------
    model : mujoco.MjModel
    materials : mapping
        Geom name to its `Material`. Geoms of type mesh, sdf, sphere, ellipsoid, capsule, cylinder and box can ripple.
        Note that MuJoCo collides a mesh geom as its convex hull; type="sdf" collides as the true surface, and so does
        a rigid flex of the same name on the same body, which then stands for the geom; see `make_collidable`. Impulses
        are exact with every integrator but RK4.
    resolution : int or mapping
        Texels along an edge of the atlas's faces, for all targets or by geom name.
    backend, operator, conserve_volume
        As for `WaveSolver`.
    two_way : bool
        Let the moving surfaces push back on the bodies that touch them or that they reach while risen, through
        `data.xfrc_applied`. What others have put there stays, as long as they add to it or set it before `step`.

    Raises
    ------
    SceneError
        For an unknown geom or one that cannot ripple, or where there is no material or resolution for it.
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
        options = {"backend": backend, "operator": operator, "conserve_volume": conserve_volume}
        _check_arguments(model, materials, resolution)
        self._geoms = {name: find_target(model, name) for name in materials}
        self._surfaces: dict[str, RippleSurface] = {}
        for name, geom in self._geoms.items():
            n = resolution[name] if isinstance(resolution, Mapping) else resolution
            self._surfaces[name] = RippleSurface(model, geom, materials[name], n, options)
            self._warn_of_collisions(name)
        self._waves = {geom: self._surfaces[name].waves for name, geom in self._geoms.items()}
        _warn_of_integrator(model)
        self._sources = Sources(model, self._waves)
        self._check_speeds = SpeedCheck(model, list(self._waves))
        self._push_back = PushBack(model, self._waves) if two_way else None
        self._time: float | None = None

    def __getitem__(self, name: str) -> WaveSolver:
        """Waves of a geom, by name."""
        return self._surface(name).waves

    def __iter__(self) -> Iterator[str]:
        return iter(self._geoms)

    def __len__(self) -> int:
        return len(self._geoms)

    @property
    def geom_ids(self) -> dict[str, int]:
        """Geom id of every rippling geom, by name."""
        return dict(self._geoms)

    @property
    def last_impulses(self) -> list[Impulse]:
        """What was given to the surfaces in the latest step, one record for each pair of geoms."""
        return self._sources.impulses

    def step(self, data: mujoco.MjData) -> None:
        """Let the contact forces of the physics step just made press on the surfaces; advance the waves to `data.time`.

        The forces and poses in `data` after `mj_step` are those at the beginning of that step, over which MuJoCo holds
        the forces: each contact gives normal force times time step. If time has gone backwards (the simulation was
        reset) the waves are reset too; if it stands still, nothing happens.
        """
        elapsed = self._elapsed(data)
        if elapsed == 0:
            self._sources.skip()
            return
        self._check_speeds(data)
        loads = self._sources.loads(data, elapsed)
        if self._push_back is not None:
            for geom, load in self._push_back.withdraw(data):
                loads[geom] = Load.together([loads[geom], load])
        for geom, waves in self._waves.items():
            waves.step(elapsed, load=loads[geom])
        if self._push_back is not None:
            self._push_back.apply(data, self._sources.touches, self._waves)

    def reset(self) -> None:
        """Flatten all surfaces."""
        self._time = None
        self._sources.clear()
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
            For an unknown or invalid coefficient.
        """
        self._surface(name).change_material(**coefficients)
        self._renew(name)

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
        self._surface(name).make_rigid(point, radius)
        self._renew(name)

    def hold(self, name: str, region: ArrayLike) -> None:
        """Let a region of a geom's surface carry no waves, as `make_rigid` does with a disc.

        Parameters
        ----------
        name : str
            Geom.
        region : bool or float [6, N, N]
            What is held; from 0 to 1, where only a share of a texel is.

        Raises
        ------
        SolverError
            If the region is of another shape, or holds numbers that are not from 0 to 1.
        """
        self._surface(name).hold(region)
        self._renew(name)

    def change_operator(self, operator: str) -> None:
        """Take another wave operator on all surfaces, by its name in `WaveSolver`; height and velocity stay.

        Raises
        ------
        SolverError
            For an unknown operator.
        """
        for name in self:
            self._surfaces[name].change_operator(operator)
            self._renew(name)

    def to_geom(self, name: str, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to that of the geom, which MuJoCo chooses for meshes."""
        return self._surface(name).to_geom(point)

    def _surface(self, name: str) -> RippleSurface:
        if name not in self._surfaces:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are {', '.join(map(repr, self._geoms))}"
            )
        return self._surfaces[name]

    def _renew(self, name: str) -> None:
        """Let everybody know of a surface's new waves."""
        geom = self._geoms[name]
        self._waves[geom] = self._surfaces[name].waves
        self._sources.renew(geom)

    def _elapsed(self, data: mujoco.MjData) -> float:
        """Time since the last step [s]; the first step, and the first after the time was set back, count as one."""
        timestep = self.model.opt.timestep
        elapsed = timestep if self._time is None else data.time - self._time
        if elapsed < 0:
            self.reset()
            elapsed = timestep
        self._time = data.time
        # a step that is as long as the last one to the last bit spares the solver new coefficients
        steps = round(elapsed / timestep)
        return steps * timestep if abs(elapsed - steps * timestep) < 1e-6 * timestep else elapsed

    def _warn_of_collisions(self, name: str) -> None:
        message, geom = None, self._geoms[name]
        if geom in shells(self.model):
            message = shell_warning(self.model, geom)
        elif collides_as_hull(self.model, geom):
            message = hull_warning(name, self._surfaces[name].waves.atlas)
        if message is not None:
            warnings.warn(message, RippleWarning, stacklevel=3)


def _check_arguments(
    model: mujoco.MjModel, materials: Mapping[str, Material], resolution: int | Mapping[str, int]
) -> None:
    if not isinstance(model, mujoco.MjModel):
        raise SceneError(f"model is {type(model).__name__}; valid is a compiled mujoco.MjModel")
    if not isinstance(materials, Mapping):
        raise SceneError(f"materials is {type(materials).__name__}; valid is a mapping of geom names to Material")
    for name in materials:
        if not isinstance(materials[name], Material):
            raise SceneError(f"material of geom {name!r} is {materials[name]!r}; valid is a Material")
        if isinstance(resolution, Mapping) and name not in resolution:
            raise SceneError(
                f"resolution has no entry for geom {name!r}; it has {', '.join(map(repr, resolution)) or 'none'}: "
                "give every rippling geom one, or one number for all"
            )


def _warn_of_integrator(model: mujoco.MjModel) -> None:
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        warnings.warn(
            "the integrator RK4 averages four contact forces in each step, of which MuJoCo keeps only the last: "
            'impulses are off by some per cent; use integrator="implicitfast", or a short time step',
            RippleWarning,
            stacklevel=3,
        )
