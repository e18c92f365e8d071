"""The state of the waves: height and velocity on an atlas, their energy, volume and momentum.

What acts on the waves: impulses, held forces and pressure, and fields that are added to height and velocity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import Backend
from ..backends.gl_fields import DeviceField
from ..operator.volume import VolumeBalance
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from .finite import FiniteGuard, Source, as_field, check_kick, require_finite
from .footprint import Footprint, footprint
from .load import HeldLoad, Load
from .motion import Motion


class WaveField:
    """Height and velocity of waves on the surface of an atlas, held by a backend.

    Attributes
    ----------
    operator : WaveOperator
    time : float
        [s].
    substeps_taken : int
    """

    def __init__(self, atlas: Atlas, operator: WaveOperator, backend: Backend) -> None:
        self._rest = atlas
        self._motion: Motion | None = None
        self.operator = operator
        self.time = 0.0
        self.substeps_taken = 0
        self._backend = backend
        self._substep = 0.0
        self._guard = FiniteGuard(atlas)

    @property
    def atlas(self) -> Atlas:
        """The surface where it is now."""
        return self._rest if self._motion is None else self._motion.atlas

    @property
    def rest(self) -> Atlas:
        """The atlas of the surface before it moved."""
        return self._rest

    @property
    def vertices(self) -> NDArray[np.float64] | None:
        """Where `WaveSolver.move` put the vertices [m], [vertex_count, 3]; None as long as it did not."""
        return None if self._motion is None else self._motion.V

    @property
    def backend(self) -> str:
        """Which backend runs: "gl" or "cpu"."""
        return self._backend.name

    @property
    def height(self) -> NDArray[np.float32]:
        """Displacement along the outward normal [m], float32 [C, n, n]: a copy; assign to change it.

        `waves.height = field` and `waves.height += field` work, also with one number; `waves.height[0] = x` changes the
        copy only. A height that is assigned is elastic: dents are gone.

        Reading raises `SolverError` once if it is no longer finite.
        """
        return self._finite(self._backend.height(), "height")

    @height.setter
    def height(self, value: ArrayLike) -> None:
        height = as_field(value, "height", self.operator.mass.shape) * self.operator.free
        self._note_height(height)
        self._backend.set_height(height)

    def crests(self) -> NDArray[np.float32]:
        """Greatest size that each height has had after any step since the last call, or has now [m], [C, n, n].

        Kept from the first call on, where the waves are; a copy of the solver begins anew. As with `height`, raises
        `SolverError` once if one is not finite.
        """
        return self._finite(self._backend.crests(), "height")

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """A copy of the height [m], [C, n, n], where the waves are: on hardware GL it stays on the GPU.

        `numpy.asarray` gives the array; `HeightMap` takes both.
        """
        heights = self._backend.snapshot()
        return self._finite(heights, "height") if isinstance(heights, np.ndarray) else heights

    @property
    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], float32 [C, n, n]; 0 unless the material yields."""
        return self._finite(self._backend.dent(), "dent")

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Rate of the height [m/s], float32 [C, n, n]: a copy; assign to change it, as with `height`.

        Reading raises `SolverError` once if it is no longer finite, which it may be before the height is.
        """
        return self._finite(self._backend.velocity(), "velocity")

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        velocity = as_field(value, "velocity", self.operator.mass.shape) * self.operator.movable
        self._note_velocity(velocity)
        self._backend.set_velocity(velocity)

    def energy(self) -> float:
        """Kinetic plus potential energy [J] of the discrete system.

        Without damping this is what the leapfrog scheme conserves to round-off while the substep stays the same:
        1/2 v' (M - dt^2/4 K) v + 1/2 h' K h, with dt the latest substep and K all elastic forces. It differs from the
        continuous energy by O(dt^2). Energy spent on dents is not included.
        """
        elastic = self._finite(self._backend.elastic(), "height")
        height, velocity = elastic.astype(np.float64), self.velocity.astype(np.float64)
        with np.errstate(invalid="ignore"):  # NaN says enough
            kinetic = float((self.operator.momenta(velocity) * velocity).sum()) / 2
            return kinetic + self._elastic_energy(height) - self._substep**2 / 4 * self._elastic_energy(velocity)

    def volume(self) -> float:
        """Volume that the waves add to the target, to first order: sum of area times height [m^3]."""
        return float((self._areas * self.height.astype(np.float64)).sum())

    @property
    def _areas(self) -> NDArray[np.float64]:
        return self._rest.areas if self._motion is None else self._motion.areas

    def momentum(self) -> float:
        """Sum of sigma A v [kg m/s], positive outwards."""
        return float((self.operator.mass * self.velocity.astype(np.float64)).sum())

    def _elastic_energy(self, field: NDArray[np.float64]) -> float:
        return -float((field * self.operator.elastic_force(field)).sum()) / 2

    def _finite(self, field: NDArray[np.float32], name: str) -> NDArray[np.float32]:
        """A field, which is looked at; see `FiniteGuard.check`."""
        self._guard.check(field, name, self.time)
        return field

    def _note_height(self, height: NDArray) -> None:
        highest = float(np.abs(height).max())
        self._guard.note(Source("height", highest, "m", self.time, highest / self.operator.stable_timestep))

    def _note_velocity(self, velocity: NDArray) -> None:
        fastest = float(np.abs(velocity).max())
        self._guard.note(Source("velocity", fastest, "m/s", self.time, fastest))


class WaveSources(WaveField):
    """Waves and the sources that act on them."""

    def __init__(self, atlas: Atlas, operator: WaveOperator, backend: Backend) -> None:
        super().__init__(atlas, operator, backend)
        self._balance = VolumeBalance(operator)
        self._held = HeldLoad(self._backend, operator.source_share)

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
        return self._held.forces() / self._areas

    @pressure.setter
    def pressure(self, value: ArrayLike) -> None:
        self._held.load = Load.none()
        self.add_pressure(value)

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
            If the impulse or the radius is not finite, the radius is negative, there are several points, or the
            velocity is beyond float32.
        """
        where, impulses = self._spread("impulse", impulse, "N s", point, radius)
        momentum = -impulses * self.operator.source_share.reshape(-1)[where.texels]
        velocities = momentum / self.operator.mass.reshape(-1)[where.texels]
        fastest = check_kick(velocities, "impulse", impulse, "N s")
        self._guard.note(Source("impulse", impulse, "N s", self.time, fastest))
        # sums too large for float32 become infinite here, and are reported later
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
        force = (field * self._areas).reshape(-1)
        texels = np.flatnonzero(force)
        self._held.add(Load(texels, force[texels]))

    def add_height(self, height: ArrayLike) -> None:
        """Raise the surface by a field [m], [C, n, n]; where volume is conserved its mean over the area is removed."""
        field = as_field(height, "height", self.operator.mass.shape).astype(np.float64) * self.operator.free
        if self.conserve_volume:
            field = self._balance.balanced_height(field, self._areas)
        self._note_height(field)
        self._backend.set_height(self._backend.elastic() + field.astype(np.float32), self._backend.dent())

    def add_velocity(self, velocity: ArrayLike) -> None:
        """Add a field [m/s], [C, n, n], to the velocity; where volume is conserved its volume rate is removed."""
        field = as_field(velocity, "velocity", self.operator.mass.shape).astype(np.float64) * self.operator.movable
        if self.conserve_volume:
            field = self._balance.balanced_velocity(field)
        self._note_velocity(field)
        self._backend.set_velocity(self._backend.velocity() + field.astype(np.float32))

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
