"""`Ripples` adds rippling surfaces to anybody's MuJoCo loop: contact forces become waves."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import mujoco

from ripple_sim.coupling.colliders.collision_warnings import collision_warning
from ripple_sim.coupling.colliders.tunnelling import TunnellingCheck
from ripple_sim.coupling.load.contact_loads import ContactLoads
from ripple_sim.coupling.load.contact_record import Impulse
from ripple_sim.coupling.model.collision_geoms import named_collision_geoms
from ripple_sim.coupling.model.coupled_model import CoupledModel
from ripple_sim.coupling.model.geoms import ByGeom, GeomKey
from ripple_sim.coupling.two_way.push_back import PushBack
from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Load, Material

from .arguments import integrator_warning
from .clock import StepClock
from .targets import Targets

__all__ = ["Impulse", "Ripples"]


class Ripples(Targets):
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

    contacts : mapping, optional
        Geom to the geoms that collide for it, where a visible geom ripples and others, on its body or on bodies welded
        to it, collide. A target that neither collides nor is named here takes the contacts of all geoms of its body
        that collide and do not ripple. A contact loads the surface where this is nearest and faces it; of several
        targets that share a geom, the nearest.

    Raises
    ------
    SceneError
        For an unknown geom or one that cannot ripple, a geom without a material or resolution, or invalid contacts.
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
        contacts: ByGeom[Sequence[GeomKey]] | None = None,
    ) -> None:
        options = {"backend": backend, "operator": operator, "conserve_volume": conserve_volume}
        super().__init__(model, materials, resolution, options)
        coupled = CoupledModel(model, self._waves, named_collision_geoms(model, self, contacts or {}))
        for geom, waves in self._waves.items():
            _warn(collision_warning(coupled, geom, waves.atlas))
        _warn(integrator_warning(model))
        self._loads = ContactLoads(coupled, self._waves)
        self._check_tunnelling = TunnellingCheck(coupled, list(self._waves))
        self._push_back = PushBack(coupled, self._waves) if two_way else None
        self._clock = StepClock()

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

    def _waves_changed(self, name: GeomKey) -> None:
        super()._waves_changed(name)
        self._loads.waves_changed(self._target(name).geom)

    def _flatten(self) -> None:
        self._loads.clear()
        if self._push_back is not None:
            self._push_back.forget()
        for waves in self._waves.values():
            waves.reset()


def _warn(message: str | None) -> None:
    if message is not None:
        warnings.warn(message, RippleWarning, stacklevel=3)
