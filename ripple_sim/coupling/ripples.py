"""`Ripples` adds rippling surfaces to anybody's MuJoCo loop: contact forces become waves."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.colliders.collision_warnings import collision_warning
from ripple_sim.coupling.colliders.tunnelling import TunnellingCheck
from ripple_sim.coupling.load.contact_loads import ContactLoads
from ripple_sim.coupling.load.contact_record import Impulse
from ripple_sim.coupling.model.coupled_model import CoupledModel
from ripple_sim.coupling.model.geoms import ByGeom, GeomKey, find_geom, geom_name
from ripple_sim.coupling.two_way.push_back import PushBack
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.solver import Load, Material, WaveSolver

from .arguments import checked_materials, integrator_warning, resolutions
from .clock import StepClock
from .target import Target

__all__ = ["Impulse", "Ripples"]


class Ripples:
    """Ripples on geoms of a MuJoCo model, driven by its contact forces.

    Call `step(data)` after each `mujoco.mj_step(model, data)`.

    Parameters
    ----------
    model : mujoco.MjModel
    materials : mapping
        Geom to its `Material`: by its name, for unnamed geoms by "body/index" (index among the geoms of its body), or
        by its id. Geoms of type mesh, sdf, sphere, ellipsoid, capsule, cylinder and box can ripple.
        Note that MuJoCo collides a mesh geom as its convex hull. A geom of type="sdf" collides as the true surface, and
        so does a mesh geom with a rigid flex of the same name on the same body, which collides in its place; see
        `make_collidable`. Impulses are exact with every integrator but RK4.
    resolution : int or mapping
        Texels along an edge of the atlas's charts, for all targets or by geom.
    backend, operator, conserve_volume
        As for `WaveSolver`.
    two_way : bool
        Let the moving surfaces push back on the bodies that touch them or are within reach of them while risen, through
        `data.xfrc_applied`. Forces of others stay there, as long as they are added or are set before `step`.

    Raises
    ------
    SceneError
        For an unknown geom or one that cannot ripple, or a geom without a material or resolution.
    RippleError
        If a geom's mesh is not a closed genus-0 surface, or a wave parameter is invalid.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        materials: ByGeom[Material],
        *,
        resolution: int | ByGeom[int] = 128,
        backend: str = "auto",
        operator: str = "fem",
        conserve_volume: bool = True,
        two_way: bool = False,
    ) -> None:
        named = checked_materials(model, materials)
        texels = resolutions(model, named, resolution)
        self.model = model
        coupled = CoupledModel(model)
        options = {"backend": backend, "operator": operator, "conserve_volume": conserve_volume}
        self._targets: dict[str, Target] = {}
        for name, material in named.items():
            geom = find_geom(model, name)
            self._targets[name] = Target(model, geom, material, texels[name], options)
            _warn(collision_warning(coupled, geom, self._targets[name].waves.atlas))
        _warn(integrator_warning(model))
        # shared with the steps below, which see new waves as soon as they are in here
        self._waves = {target.geom: target.waves for target in self._targets.values()}
        self._loads = ContactLoads(coupled, self._waves)
        self._check_tunnelling = TunnellingCheck(coupled, list(self._waves))
        self._push_back = PushBack(coupled, self._waves) if two_way else None
        self._clock = StepClock()

    def __getitem__(self, name: GeomKey) -> WaveSolver:
        """Waves of a geom, by name or id."""
        return self._target(name).waves

    def __iter__(self) -> Iterator[str]:
        return iter(self._targets)

    def __len__(self) -> int:
        return len(self._targets)

    @property
    def geom_ids(self) -> dict[str, int]:
        """Geom id of every target, by name."""
        return {name: target.geom for name, target in self._targets.items()}

    @property
    def last_impulses(self) -> list[Impulse]:
        """The impulses given to the surfaces in the latest step, one record for each pair of geoms."""
        return self._loads.impulses

    def step(self, data: mujoco.MjData) -> None:
        """Apply the contact forces of the latest physics step to the surfaces, and advance the waves to `data.time`.

        The forces and poses in `data` after `mj_step` are those at the beginning of that step, over which MuJoCo holds
        the forces: each contact gives normal force times time step. If time has gone backwards (the simulation was
        reset) the waves are reset too; if it stands still, nothing happens.
        """
        elapsed, set_back = self._clock.elapsed(data.time, self.model.opt.timestep)
        if set_back:
            self._flatten()
        if elapsed == 0:
            self._loads.skip()
            return
        self._check_tunnelling(data)
        loads = self._loads.loads(data, elapsed)
        if self._push_back is not None:
            for geom, load in self._push_back.withdraw(data):
                loads[geom] = Load.together([loads[geom], load])
        for geom, waves in self._waves.items():
            waves.step(elapsed, load=loads[geom])
        if self._push_back is not None:
            self._push_back.apply(data, self._loads.touches, self._waves)

    def reset(self) -> None:
        """Flatten all surfaces, and let time begin anew."""
        self._clock.reset()
        self._flatten()

    def change_material(self, name: GeomKey, **coefficients: Any) -> None:
        """Change coefficients of a geom's material, by their names in `Material`; height and velocity stay.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            For an unknown or invalid coefficient.
        """
        self._target(name).change_material(**coefficients)
        self._waves_changed(name)

    def make_rigid(self, name: GeomKey, point: ArrayLike, radius: float) -> None:
        """Hold a disc of a geom's surface still: waves go round it, and contacts there move nothing.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom [m]; the nearest surface point is taken.
        radius : float
            Along the surface [m].
        """
        self._target(name).make_rigid(point, radius)
        self._waves_changed(name)

    def hold(self, name: GeomKey, region: ArrayLike) -> None:
        """Hold a region of a geom's surface still, as `make_rigid` does with a disc.

        Parameters
        ----------
        name : str or int
            Geom.
        region : bool or float [C, n, n]
            The texels to hold; from 0 to 1 for a share of a texel.

        Raises
        ------
        SolverError
            If the region has another shape, or numbers that are not from 0 to 1.
        """
        self._target(name).hold(region)
        self._waves_changed(name)

    def change_operator(self, operator: str) -> None:
        """Change the wave operator on all surfaces, by its name in `WaveSolver`; height and velocity stay.

        Raises
        ------
        SolverError
            For an unknown operator.
        """
        for name, target in self._targets.items():
            target.change_operator(operator)
            self._waves_changed(name)

    def to_geom(self, name: GeomKey, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to that of the geom, which MuJoCo chooses for meshes."""
        return self._target(name).to_geom(point)

    def _target(self, name: GeomKey) -> Target:
        target = self._targets.get(name) if isinstance(name, str) else None
        if target is None:
            target = self._targets.get(geom_name(self.model, find_geom(self.model, name)))
        if target is None:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are {', '.join(map(repr, self._targets))}"
            )
        return target

    def _waves_changed(self, name: GeomKey) -> None:
        """Hand a target's new waves to everybody."""
        target = self._target(name)
        self._waves[target.geom] = target.waves
        self._loads.waves_changed(target.geom)

    def _flatten(self) -> None:
        self._loads.clear()
        if self._push_back is not None:
            self._push_back.forget()
        for waves in self._waves.values():
            waves.reset()


def _warn(message: str | None) -> None:
    if message is not None:
        warnings.warn(message, RippleWarning, stacklevel=3)
