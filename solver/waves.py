"""The wave solver: height and velocity on an atlas, impulses in, time steps forward."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .atlas import Atlas
from .errors import GLError, SolverError
from .footprint import Footprint, footprint
from .material import Material
from .operator import WaveOperator, build_operator, stencil_sum
from .stencil import pad

BACKENDS = ("auto", "gl", "cpu")


class Backend(Protocol):
    """What a backend does: hold height and velocity as float32, kick texels, and take leapfrog substeps."""

    name: str

    def height(self) -> NDArray[np.float32]: ...  # noqa: D102
    def velocity(self) -> NDArray[np.float32]: ...  # noqa: D102
    def set_height(self, height: NDArray[np.float32]) -> None: ...  # noqa: D102
    def set_velocity(self, velocity: NDArray[np.float32]) -> None: ...  # noqa: D102
    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float64], everywhere: float) -> None: ...  # noqa: D102
    def advance(self, substeps: int, dt: float) -> None: ...  # noqa: D102


def make_backend(name: str, operator: WaveOperator) -> Backend:
    """Backend by name; "auto" takes GL where the driver is hardware, else the CPU.

    Raises
    ------
    SolverError
        For an unknown name.
    GLError
        If "gl" is asked for and no context can be made.
    """
    if name not in BACKENDS:
        raise SolverError(f"backend {name!r} does not exist; valid are {', '.join(map(repr, BACKENDS))}")
    if name == "auto":
        name = auto_backend()
    if name == "gl":
        from .backend_gl import GLBackend

        return GLBackend(operator)
    from .backend_cpu import CPUBackend

    return CPUBackend(operator)


def auto_backend() -> str:
    """What "auto" means on this machine: "gl" or "cpu"."""
    from .gl import shared_context

    try:
        return "cpu" if shared_context().software else "gl"
    except GLError:
        return "cpu"


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
        For invalid names or a material of another resolution.
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
        self.atlas = atlas
        self.material = material if material is not None else Material()
        self.conserve_volume = conserve_volume
        self.operator = build_operator(atlas, self.material, operator)
        self.time = 0.0
        self.substeps_taken = 0
        self._backend = make_backend(backend, self.operator)
        self._total_mass = float(self.operator.mass.sum())
        self._substep = 0.0

    @property
    def backend(self) -> str:
        """Which backend runs: "gl" or "cpu"."""
        return self._backend.name

    @property
    def height(self) -> NDArray[np.float32]:
        """Displacement along the outward normal [m], float32 [6, N, N]: a read-only copy; assign to change it."""
        return _frozen(self._backend.height())

    @height.setter
    def height(self, value: ArrayLike) -> None:
        self._backend.set_height(self._field(value, "height"))

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Rate of the height [m/s], float32 [6, N, N]: a read-only copy; assign to change it."""
        return _frozen(self._backend.velocity())

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._backend.set_velocity(self._field(value, "velocity"))

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
            where volume is conserved).
        radius : float
            Footprint radius [m], along the surface; at least two texels are used.

        Returns
        -------
        Footprint
            The texels that were hit.

        Raises
        ------
        SolverError
            If the impulse or the radius is not finite, or the radius is negative.
        """
        if not np.isfinite(impulse):
            raise SolverError(f"impulse is {impulse!r} N s; valid is a finite number")
        where = footprint(self.atlas, point, radius)
        mass = self.operator.mass.reshape(-1)[where.texels]
        area = self.atlas.areas.reshape(-1)[where.texels]
        everywhere = impulse / self._total_mass if self.conserve_volume else 0.0
        self._backend.kick(where.texels, -impulse * where.weights * area / mass, everywhere)
        return where

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Advance by dt [s] in equal substeps, as many as stability asks for.

        Raises
        ------
        SolverError
            If dt is negative or not finite, or a given number of substeps is too small to be stable.
        """
        if not (np.isfinite(dt) and dt >= 0):
            raise SolverError(f"time step is {dt!r} s; valid is a finite number, 0 or greater")
        if dt == 0:
            return
        needed = max(1, int(np.ceil(dt / self.stable_timestep * (1 - 1e-12))))
        if substeps is None:
            substeps = needed
        elif substeps < needed:
            raise SolverError(
                f"{substeps} substeps of {dt / max(substeps, 1):.4g} s are longer than the stable "
                f"{self.stable_timestep:.4g} s; use {needed} or more substeps, or leave the number out"
            )
        self._substep = dt / substeps
        self._backend.advance(substeps, self._substep)
        self.time += dt
        self.substeps_taken += substeps

    def reset(self) -> None:
        """Flatten the surface and set the time back to 0."""
        shape = self.operator.mass.shape
        self.height = np.zeros(shape, np.float32)
        self.velocity = np.zeros(shape, np.float32)
        self.time, self.substeps_taken = 0.0, 0

    def energy(self) -> float:
        """Kinetic plus potential energy [J] of the discrete system.

        Without damping this is what the leapfrog scheme conserves to round-off while the substep stays the same:
        1/2 v' (M - dt^2/4 K) v + 1/2 h' K h, with dt the latest substep. It differs from the continuous energy by
        O(dt^2).
        """
        height, velocity = self.height.astype(np.float64), self.velocity.astype(np.float64)
        kinetic = float((self.operator.mass * velocity**2).sum()) / 2
        return kinetic + self._elastic_energy(height) - self._substep**2 / 4 * self._elastic_energy(velocity)

    def volume(self) -> float:
        """Volume that the waves add to the target, to first order: sum of area times height [m^3]."""
        return float((self.atlas.areas * self.height.astype(np.float64)).sum())

    def momentum(self) -> float:
        """Sum of sigma A v [kg m/s], positive outwards."""
        return float((self.operator.mass * self.velocity.astype(np.float64)).sum())

    def _elastic_energy(self, field: NDArray[np.float64]) -> float:
        force = stencil_sum(self.operator.stencil, pad(field)) - self.operator.mass * self.operator.stiffness * field
        return -float((field * force).sum()) / 2

    def _field(self, value: ArrayLike, name: str) -> NDArray[np.float32]:
        array = np.asarray(value, dtype=np.float32)
        shape = self.operator.mass.shape
        if array.shape != shape:
            raise SolverError(f"{name} has shape {array.shape}; valid is {shape}")
        if not np.isfinite(array).all():
            raise SolverError(f"{name} holds {(~np.isfinite(array)).sum()} values that are NaN or infinite")
        return array


def _frozen(array: NDArray[np.float32]) -> NDArray[np.float32]:
    array.flags.writeable = False
    return array
