"""The wave solver: impulses and loads in, time steps forward."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.checked import checked, instance
from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.material import Material
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.operator.wavelengths import warn_of_wavelengths
from ripple_sim.solver.texels.atlas import Atlas

from .finite import as_field, require_finite
from .footprint import Footprint, footprint
from .held_load import HeldLoad
from .load import Load
from .substeps import count_substeps
from .volume_balance import VolumeBalance
from .wave_field import WaveField
from .wave_state import WaveState


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
    rim : str
        At the rims of an open surface waves come back upright from a "free" one, inverted from a "fixed" one, as on a
        drum skin: there the height is 0, and the moment of a surface that bends. A closed surface has none.
    conserve_volume : bool
        Remove the mean of every source, so that a net push does not move the surface as a whole. On a closed surface
        without stiffness nothing else would stop it; there, the mean is the volume. On an open surface it is the mean
        height. Each part of a mesh, and each region that rigid texels cut off, has a mean of its own. Where the density
        varies, a uniform pressure keeps the volume while the waves run as well, unless something holds the surface: a
        clamp, a fixed rim, or stiffness that varies.

    Raises
    ------
    SolverError
        For invalid names, a material of another type, or a material of another resolution.
    GLError
        If "gl" is asked for and no context can be made.
    """

    @checked(
        SolverError,
        atlas=instance(Atlas, ", from build_atlas or sphere_atlas"),
        material=instance(Material, ", for instance Material(speed=1.0)", optional=True),
    )
    def __init__(
        self,
        atlas: Atlas,
        material: Material | None = None,
        *,
        backend: str = "auto",
        operator: str = "fem",
        rim: str = "free",
        conserve_volume: bool = True,
    ) -> None:
        self.material = material if material is not None else Material()
        warn_of_wavelengths(atlas, self.material)
        self._begin(atlas, build_operator(atlas, self.material, operator, rim), backend, conserve_volume)

    def _begin(self, atlas: Atlas, operator: WaveOperator, backend: str, conserve_volume: bool) -> None:
        """At rest, at time 0."""
        super().__init__(atlas, operator, make_backend(backend, operator, keeps_volume=conserve_volume))
        self._balance = VolumeBalance(operator)
        self._held = HeldLoad(self._backend, operator.source_share)

    def __getstate__(self) -> tuple[Any, ...]:
        """What `copy` and `pickle` keep: a copy goes on as the original does, bit for bit."""
        return self.atlas, self.material, self.operator, self.backend, self.conserve_volume, self.state

    def __setstate__(self, kept: tuple[Any, ...]) -> None:
        atlas, self.material, operator, backend, conserve_volume, state = kept
        self._begin(atlas, operator, backend, conserve_volume)
        self.state = state

    @property
    def state(self) -> WaveState:
        """All that decides how the waves go on, but for atlas and material; assign it to another solver.

        Assigning raises `SolverError` for a state of another resolution. Where the solver's own material clamps the
        surface or carries no waves, it takes over dents alone, and comes to rest.
        """
        backend = self._backend
        return WaveState(
            backend.elastic(),
            backend.dent(),
            backend.velocity(),
            self._held.load,
            self.time,
            self._substep,
            self.substeps_taken,
        )

    @state.setter
    def state(self, state: WaveState) -> None:
        shape = self.operator.mass.shape
        if state.elastic.shape != shape:
            raise SolverError(f"the state of waves has shape {state.elastic.shape}; valid is {shape}")
        self._backend.set_height(state.elastic * self.operator.free, state.dent)
        self._backend.set_velocity(state.velocity * self.operator.movable)
        self._held.load = state.held
        self.time, self._substep, self.substeps_taken = state.time, state.substep, state.substeps_taken
        self._reported = False

    @property
    def conserve_volume(self) -> bool:
        """Whether sources are rid of their mean; may be changed while the waves run."""
        return self._backend.keeps_volume

    @conserve_volume.setter
    def conserve_volume(self, value: bool) -> None:
        self._backend.keeps_volume = value

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Pressure held over `step` [Pa], positive inwards, float64 [C, n, n]; assign to change it, 0 to end it.

        A copy; it holds the forces of `add_force` as well.
        """
        return self._held.forces() / self.atlas.areas

    @pressure.setter
    def pressure(self, value: ArrayLike) -> None:
        self._held.load = Load.none()
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
            where volume is conserved). The part on clamped or rigid texels is lost to what supports them.
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
        momentum = -impulses * self.operator.source_share.reshape(-1)[where.texels]
        velocities = momentum / self.operator.mass.reshape(-1)[where.texels]
        # values too large for float32 become infinite here, and are reported by the next step
        with np.errstate(over="ignore"):
            self._backend.kick(where.texels, velocities.astype(np.float32), self._counterpart(where.texels, momentum))
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
        field = as_field(pressure, "pressure", shape)
        force = (field * self.atlas.areas).reshape(-1)
        texels = np.flatnonzero(force)
        self._held.add(Load(texels, force[texels]))

    def add_height(self, height: ArrayLike) -> None:
        """Raise the surface by a field [m], [C, n, n]; where volume is conserved its mean over the area is removed."""
        field = as_field(height, "height", self.operator.mass.shape).astype(np.float64) * self.operator.free
        if self.conserve_volume:
            field = self._balance.balanced_height(field, self.atlas.areas)
        self._backend.set_height(self._backend.elastic() + field.astype(np.float32), self._backend.dent())

    def add_velocity(self, velocity: ArrayLike) -> None:
        """Add a field [m/s], [C, n, n], to the velocity; where volume is conserved its volume rate is removed."""
        field = as_field(velocity, "velocity", self.operator.mass.shape).astype(np.float64) * self.operator.movable
        if self.conserve_volume:
            field = self._balance.balanced_velocity(field)
        self._backend.set_velocity(self._backend.velocity() + field.astype(np.float32))

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
        """Footprint of a point source, and the part of its value on each texel, [k]."""
        require_finite(name, value, unit)
        where = footprint(self.atlas, point, radius)
        return where, value * (where.weights * self.atlas.areas.reshape(-1)[where.texels])

    def _counterpart(self, texels: NDArray[np.int64], momenta: NDArray[np.float64]) -> float | NDArray[np.float64]:
        """What balances the momenta of a source on some texels, or the forces of a load, where volume is conserved."""
        return self._balance.counterpart(texels, momenta) if self.conserve_volume else 0.0
