"""The wave solver: impulses and loads in, time steps forward."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.material import Material
from ripple_sim.solver.texels.atlas import Atlas

from .finite import as_field, require_finite
from .footprint import Footprint, footprint
from .held_load import HeldLoad
from .load import Load
from .substeps import count_substeps
from .wave_field import WaveField


class WaveSolver(WaveField):
    """Waves on the surface of an atlas.

    Time stepping is leapfrog in its drift-kick-drift form with implicit damping: second order, stable up to
    `stable_timestep`, height and velocity at the same time.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    backend : str
        "gl" (compute shaders), "cpu" (numba), or "auto": GL on a hardware driver, else the CPU.
    operator : str
        "fem", or a baseline: "paper", "uncorrected", "dynamic-paint" (see `build_operator`).
    conserve_volume : bool
        Remove the mean of every source, so that a net push does not move the surface as a whole. On a closed surface
        without stiffness nothing else would stop it.

    Raises
    ------
    SolverError
        For invalid names, a material of another type, or a material of another resolution.
    GLError
        If "gl" is asked for and no context can be made.
    """

    def __init__(
        self,
        atlas: Atlas,
        material: Material | None = None,
        *,
        backend: str = "auto",
        operator: str = "fem",
        conserve_volume: bool = True,
    ) -> None:
        if not (material is None or isinstance(material, Material)):
            raise SolverError(f"material is {material!r}; valid is a Material, for instance Material(speed=1.0)")
        self.material = material if material is not None else Material()
        wave_operator = build_operator(atlas, self.material, operator)
        super().__init__(atlas, wave_operator, make_backend(backend, wave_operator))
        self.conserve_volume = conserve_volume
        self._movable_mass = float(wave_operator.mass[wave_operator.movable].sum())
        self._held = HeldLoad(self._backend, wave_operator.mass.shape)

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Pressure held over `step` [Pa], positive inwards, float64 [C, n, n]; assign to change it, 0 to end it.

        A copy; it holds the forces of `add_force` as well.
        """
        return self._held.forces() / self.atlas.areas

    @pressure.setter
    def pressure(self, value: ArrayLike) -> None:
        self._held.clear()
        self.add_pressure(value)

    @property
    def stable_timestep(self) -> float:
        """Longest substep that is stable [s]."""
        return self.operator.stable_timestep

    def add_impulse(self, point: ArrayLike, impulse: float, radius: float) -> Footprint:
        """Press on the surface for an instant.

        Parameters
        ----------
        point : [3]
            Where [m], in the frame of the mesh; the nearest surface point is taken.
        impulse : float
            J [N s]. Positive presses inwards: the sum of sigma A dv over the texels is -J (before the mean is removed,
            where volume is conserved). The part on clamped or rigid texels is lost to their support.
        radius : float
            Footprint radius [m], along the surface; at least two texels are used.

        Returns
        -------
        Footprint
            The texels that were hit.

        Raises
        ------
        SolverError
            If the impulse or the radius is not finite, the radius is negative, or there are several points.
        """
        where, impulses = self._spread("impulse", impulse, "N s", point, radius)
        momentum = -impulses
        velocities = momentum / self.operator.mass.reshape(-1)[where.texels]
        # values too large for float32 become infinite here, and are reported by the next step
        with np.errstate(over="ignore"):
            self._backend.kick(where.texels, velocities.astype(np.float32), self._counterpart(momentum.sum()))
        return where

    def add_force(self, point: ArrayLike, force: float, radius: float) -> Footprint:
        """Press on the surface from now on, until `pressure` is assigned.

        Parameters
        ----------
        point : [3]
            Where [m], in the frame of the mesh; the nearest surface point is taken.
        force : float
            [N], positive inwards.
        radius : float
            Footprint radius [m], along the surface; at least two texels are used.

        Raises
        ------
        SolverError
            If the force or the radius is not finite, the radius is negative, or there are several points.
        """
        where, forces = self._spread("force", force, "N", point, radius)
        self._held.add(Load(where.texels, forces))
        return where

    def add_pressure(self, pressure: ArrayLike) -> None:
        """Add a pressure field [Pa], a number or [C, n, n], positive inwards, that is held from now on."""
        shape = self.operator.mass.shape
        field = as_field(np.broadcast_to(pressure, shape), "pressure", shape)
        force = (field * self.atlas.areas * self.operator.movable).reshape(-1)
        texels = np.flatnonzero(force)
        self._held.add(Load(texels, force[texels]))

    def add_height(self, height: ArrayLike) -> None:
        """Raise the surface by a field [m], [C, n, n]; where volume is conserved its mean over the area is removed."""
        field = self._source(height, "height", self.atlas.areas)
        dent = self._backend.dent()
        self._backend.set_height(self._backend.height() - dent + field, dent)

    def add_velocity(self, velocity: ArrayLike) -> None:
        """Add a field [m/s], [C, n, n], to the velocity; where volume is conserved its net momentum is removed."""
        field = self._source(velocity, "velocity", self.operator.mass)
        self._backend.set_velocity(self._backend.velocity() + field)

    def step(self, dt: float, substeps: int | None = None, load: Load | None = None) -> None:
        """Advance by dt [s] in equal substeps, as many as stability asks for.

        Parameters
        ----------
        dt : float
            [s].
        substeps : int, optional
            How many, instead of the fewest.
        load : Load, optional
            Forces that act over this step alone, beside those that are held.

        Raises
        ------
        SolverError
            If dt is negative or not finite, a given number of substeps is too small to be stable, a load is not finite
            or names no texel, or the height is no longer finite (on the GPU this is seen when the height is read).
        """
        require_finite("time step", dt, "s", least=0.0)
        if dt == 0:
            return
        substeps = count_substeps(dt, self.stable_timestep, substeps)
        self._substep = dt / substeps
        # values too large for float32 become infinite here, and are reported below
        with np.errstate(over="ignore", invalid="ignore"):
            self._held.upload(load, self._counterpart)
            self._backend.advance(substeps, self._substep)
        self.time += dt
        self.substeps_taken += substeps
        if not self._backend.finite():
            self._check_finite(self._backend.height())

    def reset(self) -> None:
        """Flatten the surface, end all pressure, and set the time back to 0."""
        shape = self.operator.mass.shape
        self.height = np.zeros(shape, np.float32)
        self.velocity = np.zeros(shape, np.float32)
        self.pressure = 0.0
        self.time, self.substeps_taken, self._reported = 0.0, 0, False

    def _spread(
        self, name: str, value: float, unit: str, point: ArrayLike, radius: float
    ) -> tuple[Footprint, NDArray[np.float64]]:
        """Footprint of a point source, and the part of its value on each texel, [k]; 0 on texels that do not move."""
        require_finite(name, value, unit)
        where = footprint(self.atlas, point, radius)
        area, movable = self.atlas.areas.reshape(-1), self.operator.movable.reshape(-1)
        return where, value * (where.weights * area[where.texels] * movable[where.texels])

    def _counterpart(self, momentum: float) -> float:
        """Velocity of all movable texels that balances the momentum of a source; acceleration, for a force."""
        return -float(momentum) / self._movable_mass if self.conserve_volume and self._movable_mass else 0.0

    def _source(self, value: ArrayLike, name: str, weight: NDArray[np.float64]) -> NDArray[np.float32]:
        """A field that is added, without its weighted mean where volume is conserved."""
        field = as_field(value, name, self.operator.mass.shape).astype(np.float64) * self.operator.free
        movable = self.operator.movable
        if self.conserve_volume and movable.any():
            field -= movable * ((weight * field).sum() / weight[movable].sum())
        return field.astype(np.float32)
