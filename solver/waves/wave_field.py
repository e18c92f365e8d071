"""The state of the waves: height and velocity on an atlas, their energy, volume and momentum."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.backends.backend import Backend
from ripple_sim.solver.backends.device_field import DeviceField
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.atlas import Atlas

from .finite import as_field
from .finite_guard import FiniteGuard, Source
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
