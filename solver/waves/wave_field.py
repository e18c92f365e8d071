"""The state of the waves: height and velocity on an atlas, their energy, volume and momentum."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.backends.backend import Backend
from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.atlas import Atlas

from .finite import as_field, where_not_finite


class WaveField:
    """Height and velocity of waves on the surface of an atlas, held by a backend.

    Attributes
    ----------
    atlas : Atlas
    operator : WaveOperator
    time : float
        [s].
    substeps_taken : int
    """

    def __init__(self, atlas: Atlas, operator: WaveOperator, backend: Backend) -> None:
        self.atlas = atlas
        self.operator = operator
        self.time = 0.0
        self.substeps_taken = 0
        self._backend = backend
        self._substep = 0.0
        self._reported = False

    @property
    def backend(self) -> str:
        """Which backend runs: "gl" or "cpu"."""
        return self._backend.name

    @property
    def height(self) -> NDArray[np.float32]:
        """Displacement along the outward normal [m], float32 [C, n, n]: a copy; assign to change it.

        `waves.height = field` and `waves.height += field` work, also with one number; `waves.height[0] = x` changes the
        copy only. A height that is assigned is elastic: dents are gone.

        Reading raises `SolverError` if the GPU has met a value that is not finite.
        """
        height = self._backend.height()
        self._check_finite(height)
        return height

    @height.setter
    def height(self, value: ArrayLike) -> None:
        self._backend.set_height(as_field(value, "height", self.operator.mass.shape) * self.operator.free)

    @property
    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], float32 [C, n, n]; 0 unless the material yields."""
        return self._backend.dent()

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Rate of the height [m/s], float32 [C, n, n]: a copy; assign to change it, as with `height`.

        Reading raises `SolverError` if it is no longer finite, which it may be before the height is.
        """
        velocity = self._backend.velocity()
        self._check_finite(velocity, "velocity")
        return velocity

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._backend.set_velocity(as_field(value, "velocity", self.operator.mass.shape) * self.operator.movable)

    def energy(self) -> float:
        """Kinetic plus potential energy [J] of the discrete system.

        Without damping this is what the leapfrog scheme conserves to round-off while the substep stays the same:
        1/2 v' (M - dt^2/4 K) v + 1/2 h' K h, with dt the latest substep and K all elastic forces. It differs from the
        continuous energy by O(dt^2). Energy spent on dents is not included.
        """
        elastic = self._backend.elastic()
        self._check_finite(elastic)
        height, velocity = elastic.astype(np.float64), self.velocity.astype(np.float64)
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

    def _check_finite(self, field: NDArray[np.float32], name: str = "height") -> None:
        """Report once, with place and time, that a field is no longer finite."""
        if self._reported:
            return
        where = where_not_finite(self.atlas, field)
        if where is not None:
            self._reported = True
            raise SolverError(
                f"{name} is no longer finite {where}, at time {self.time:.6g} s; a source was too large for float32: "
                "make it smaller and `reset()` the waves"
            )
