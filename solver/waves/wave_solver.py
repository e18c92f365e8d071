"""The wave solver: height and velocity on an atlas, impulses in, time steps forward."""

from __future__ import annotations

import numbers

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.material import Material
from ripple_sim.solver.texels.atlas import Atlas

from .finite import where_not_finite
from .footprint import Footprint, footprint
from .load import Load

# A step that needs more is a mistake in a unit, and would run for ever.
_MOST_SUBSTEPS = 1_000_000


class WaveSolver:
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
        self.atlas = atlas
        self.material = material if material is not None else Material()
        self.conserve_volume = conserve_volume
        self.operator = build_operator(atlas, self.material, operator)
        self.time = 0.0
        self.substeps_taken = 0
        self._backend = make_backend(backend, self.operator)
        self._movable_mass = float(self.operator.mass[self.operator.movable].sum())
        self._substep = 0.0
        self._held = Load.none()
        self._uploaded = self._held
        self._reported = False

    @property
    def backend(self) -> str:
        """Which backend runs: "gl" or "cpu"."""
        return self._backend.name

    @property
    def height(self) -> NDArray[np.float32]:
        """Displacement along the outward normal [m], float32 [C, n, n]: a copy; assign to change it.

        `waves.height = field` and `waves.height += field` work, also with one number; `waves.height[0] = x` changes the
        copy only.

        Reading raises `SolverError` if the GPU has met a value that is not finite.
        """
        height = self._backend.height()
        self._check_finite(height)
        return height

    @height.setter
    def height(self, value: ArrayLike) -> None:
        self._backend.set_height(self._field(value, "height") * self.operator.free)

    @property
    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], float32 [C, n, n]; 0 unless the material yields."""
        return self._backend.dent()

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Rate of the height [m/s], float32 [C, n, n]: a copy; assign to change it, as with `height`."""
        return self._backend.velocity()

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._backend.set_velocity(self._field(value, "velocity") * self.operator.free)

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Pressure held over `step` [Pa], positive inwards, float64 [C, n, n]; assign to change it, 0 to end it.

        A copy; it holds the forces of `add_force` as well.
        """
        force = np.bincount(self._held.texels, self._held.forces, self.operator.mass.size)
        return force.reshape(self.operator.mass.shape) / self.atlas.areas

    @pressure.setter
    def pressure(self, value: ArrayLike) -> None:
        self._held = Load.none()
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
            where volume is conserved). What falls on clamped or rigid texels is lost to whatever holds them.
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
        _require_finite("impulse", impulse, "N s")
        where = footprint(self.atlas, point, radius)
        momentum = -impulse * self._shares(where)
        velocities = momentum / self.operator.mass.reshape(-1)[where.texels]
        # what float32 cannot hold becomes infinite here, and is reported by the next step
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
        _require_finite("force", force, "N")
        where = footprint(self.atlas, point, radius)
        self._hold(Load(where.texels, force * self._shares(where)))
        return where

    def add_pressure(self, pressure: ArrayLike) -> None:
        """Add a pressure field [Pa], a number or [C, n, n], positive inwards, that is held from now on."""
        field = self._field(np.broadcast_to(pressure, self.operator.mass.shape), "pressure")
        force = (field * self.atlas.areas * self.operator.movable).reshape(-1)
        texels = np.flatnonzero(force)
        self._hold(Load(texels, force[texels]))

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
        _require_finite("time step", dt, "s", least=0.0)
        if dt == 0:
            return
        ratio = dt / self.stable_timestep * (1 - 1e-12)
        if not ratio < _MOST_SUBSTEPS:
            raise SolverError(
                f"a step of {dt:.4g} s would take {ratio:.3g} substeps of the stable {self.stable_timestep:.4g} s; "
                f"valid are {_MOST_SUBSTEPS} at most: take shorter steps, or a material with slower waves"
            )
        needed = max(1, int(np.ceil(ratio)))
        if substeps is None:
            substeps = needed
        elif substeps < needed:
            raise SolverError(
                f"{substeps} substeps of {dt / max(substeps, 1):.4g} s are longer than the stable "
                f"{self.stable_timestep:.4g} s; use {needed} or more substeps, or leave the number out"
            )
        self._substep = dt / substeps
        # what float32 cannot hold becomes infinite here, and is reported below
        with np.errstate(over="ignore", invalid="ignore"):
            self._upload(self._held if load is None else Load.together([self._held, load]))
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

    def energy(self) -> float:
        """Kinetic plus potential energy [J] of the discrete system.

        Without damping this is what the leapfrog scheme conserves to round-off while the substep stays the same:
        1/2 v' (M - dt^2/4 K) v + 1/2 h' K h, with dt the latest substep and K all elastic forces. It differs from the
        continuous energy by O(dt^2). What a dent has swallowed is not in it.
        """
        height, velocity = self.height.astype(np.float64) - self.dent, self.velocity.astype(np.float64)
        with np.errstate(invalid="ignore"):  # NaN says enough
            kinetic = float((self.operator.mass * velocity**2).sum()) / 2
            return kinetic + self._elastic_energy(height) - self._substep**2 / 4 * self._elastic_energy(velocity)

    def volume(self) -> float:
        """Volume that the waves add to the target, to first order: sum of area times height [m^3]."""
        return float((self.atlas.areas * self.height.astype(np.float64)).sum())

    def momentum(self) -> float:
        """Sum of sigma A v [kg m/s], positive outwards."""
        return float((self.operator.mass * self.velocity.astype(np.float64)).sum())

    def _elastic_energy(self, field: NDArray[np.float64]) -> float:
        return -float((field * self.operator.elastic_force(field)).sum()) / 2

    def _hold(self, load: Load) -> None:
        self._held = Load.together([self._held, load]).merged(self.operator.mass.size)

    def _upload(self, load: Load) -> None:
        """Hand the backend what presses in the coming step, unless it has that already."""
        if load is self._uploaded or not (len(load.texels) or len(self._uploaded.texels)):
            return
        once = load.merged(self.operator.mass.size)
        total = float(once.forces.sum())
        if not np.isfinite(total):
            raise SolverError(f"the forces of a load add up to {total!r} N; valid are finite numbers")
        self._backend.load(once.texels, -once.forces, self._counterpart(-total))
        self._uploaded = load

    def _shares(self, where: Footprint) -> NDArray[np.float64]:
        """Share of a unit source that each texel of a footprint takes up, [k]."""
        area, movable = self.atlas.areas.reshape(-1), self.operator.movable.reshape(-1)
        return where.weights * area[where.texels] * movable[where.texels]

    def _counterpart(self, momentum: float) -> float:
        """What all movable texels are given so that a source of this momentum has none in the end."""
        return -float(momentum) / self._movable_mass if self.conserve_volume and self._movable_mass else 0.0

    def _source(self, value: ArrayLike, name: str, weight: NDArray[np.float64]) -> NDArray[np.float32]:
        """A field that is added, without its weighted mean where volume is conserved."""
        field = self._field(value, name).astype(np.float64) * self.operator.free
        movable = self.operator.movable
        if self.conserve_volume and movable.any():
            field -= movable * ((weight * field).sum() / weight[movable].sum())
        return field.astype(np.float32)

    def _field(self, value: ArrayLike, name: str) -> NDArray[np.float32]:
        array = np.asarray(value, dtype=np.float32)
        shape = self.operator.mass.shape
        if array.shape not in ((), shape):
            raise SolverError(f"{name} has shape {array.shape}; valid is {shape}, or one number")
        array = np.broadcast_to(array, shape)
        if not np.isfinite(array).all():
            raise SolverError(f"{name} holds {(~np.isfinite(array)).sum()} values that are NaN or infinite")
        return array

    def _check_finite(self, height: NDArray[np.float32]) -> None:
        """Report once, with place and time, that the height is no longer finite."""
        if self._reported:
            return
        where = where_not_finite(self.atlas, height)
        if where is not None:
            self._reported = True
            raise SolverError(
                f"height is no longer finite {where}, at time {self.time:.6g} s; a source was too large for float32: "
                "make it smaller and `reset()` the waves"
            )


def _require_finite(name: str, value: float, unit: str, least: float = -np.inf) -> None:
    if not (isinstance(value, numbers.Real) and np.isfinite(value) and value >= least):
        bound = "" if least == -np.inf else f", {least:g} or greater"
        raise SolverError(f"{name} is {value!r} {unit}; valid is a finite number{bound}")
