"""What acts on the waves: impulses, held forces and pressure, and fields that are added to height and velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import Backend
from ..operator.volume_balance import VolumeBalance
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from .finite import as_field, require_finite
from .finite_guard import Source, check_kick
from .footprint import Footprint, footprint
from .held_load import HeldLoad
from .load import Load
from .wave_field import WaveField


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
