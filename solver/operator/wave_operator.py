"""The discrete wave operator: stencil weights, masses, and the largest time step they allow."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..texels.spectrum import largest_eigenvalue
from ..texels.stencil import Stencil
from ..texels.topology import TexelTopology
from .components import Ties, floating_parts

# Share of the theoretical stability limit that is used: round-off in float32 must not cross it.
SAFETY = 0.99

# What does not change as the surface moves.
_OF_REST = ("free", "movable", "anchored", "source_share", "lightness", "response", "parts")


@dataclasses.dataclass(frozen=True, eq=False)
class WaveOperator:
    """M h_tt = -(K + L B L) h - M zeta h_t - M k h - D h_t on the texels; stencils give K, L and D.

    Attributes
    ----------
    stencil : Stencil
        Link weights of K [kg/s^2].
    mass : float64 [C, n, n]
        sigma A [kg].
    damping, stiffness : float64 [C, n, n]
        zeta [1/s] and k [1/s^2].
    viscous_stencil : Stencil or None
        Link weights of D [kg/s]; None without viscosity.
    laplace_stencil : Stencil or None
        Link weights of L, which gives the area integral of the Laplacian; None without bending.
    rigidity : float64 [C, n, n] or None
        B = sigma b / A [kg/s^2]: L B L is the bi-Laplacian's symmetric form, B L h a plate's moments.
    yield_height : float64 [C, n, n] or None
        [m]; None where everything is elastic.
    fixed : bool [C, n, n] or None
        Texels that are clamped.
    grip : float64 [C, n, n] or None
        Share of a source that sets a texel in motion, where it is movable; None: 1 everywhere.
    density : float64 [C, n, n] or None
        sigma [kg/m^2], in any unit; None where it is uniform.
    bounded : bool
        Whether the stable step follows from Gershgorin's bound, at once, rather than from the eigenvalue itself.
    """

    stencil: Stencil
    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    viscous_stencil: Stencil | None = None
    laplace_stencil: Stencil | None = None
    rigidity: NDArray[np.float64] | None = None
    yield_height: NDArray[np.float64] | None = None
    fixed: NDArray[np.bool_] | None = None
    grip: NDArray[np.float64] | None = None
    density: NDArray[np.float64] | None = None
    bounded: bool = False

    @property
    def topology(self) -> TexelTopology:
        """How the charts are connected."""
        return self.stencil.topology

    @functools.cached_property
    def free(self) -> NDArray[np.bool_]:
        """Texels that are not clamped, [C, n, n]."""
        return np.ones(self.mass.shape, bool) if self.fixed is None else ~self.fixed

    @functools.cached_property
    def movable(self) -> NDArray[np.bool_]:
        """Texels that sources may move: free, and with something that pulls back. All, where nothing pulls anywhere."""
        pulled = (self.stencil.absolute_sums() > 0) | (self.stiffness > 0)
        if self.rigidity is not None:
            pulled |= self.rigidity > 0
        movable = pulled & self.free
        return movable if movable.any() else self.free

    @functools.cached_property
    def anchored(self) -> NDArray[np.bool_]:
        """Free texels that a link ties to what is clamped, [C, n, n]."""
        free = self.free.astype(np.float64)
        tied = self.stencil(free) != 0
        if self.laplace_stencil is not None:
            tied |= self.laplace_stencil(free) != 0
        return tied & self.free

    @functools.cached_property
    def source_share(self) -> NDArray[np.float64]:
        """Share of a source that sets each texel in motion, [C, n, n]; what lies below the surface takes the rest."""
        return np.where(self.movable, 1.0 if self.grip is None else self.grip, 0.0)

    @functools.cached_property
    def lightness(self) -> NDArray[np.float64]:
        """Greatest density over that of each texel, [C, n, n]: how much more a pressure moves it."""
        return np.ones(self.mass.shape) if self.density is None else self.density.max() / self.density

    @functools.cached_property
    def response(self) -> NDArray[np.float64]:
        """How the surface moves under a pressure that acts everywhere, [C, n, n]; 1 where all of it is alike."""
        return self.source_share * self.lightness

    @functools.cached_property
    def parts(self) -> NDArray[np.int32] | None:
        """Number of the freely floating part to which each texel belongs, [C, n, n], or None: `floating_parts`."""
        ties = [Ties(self.stencil)]
        if self.laplace_stencil is not None and self.rigidity is not None:
            ties.append(Ties(self.laplace_stencil, self.rigidity))
        return floating_parts(ties, (self.stiffness > 0) | self.anchored, self.movable)

    def moved(
        self,
        stencil: Stencil,
        viscous_stencil: Stencil | None,
        laplace_stencil: Stencil | None,
        rigidity: NDArray[np.float64] | None,
    ) -> WaveOperator:
        """The same surface with its texels elsewhere: masses, and what holds or parts it, stay."""
        moved = dataclasses.replace(
            self,
            stencil=stencil,
            viscous_stencil=viscous_stencil,
            laplace_stencil=laplace_stencil,
            rigidity=rigidity,
            bounded=True,
        )
        for name in _OF_REST:
            moved.__dict__[name] = getattr(self, name)
        return moved

    def momenta(self, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Momentum of what moves with the surface [N s], float64 [C, n, n]."""
        return self.mass * velocity

    def elastic_force(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        """-(K + L B L + M k) h [N], float64 [C, n, n]; what holds the clamped texels is left out."""
        return self.link_force(height) - self.mass * self.stiffness * height

    def link_force(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        """-(K + L B L) h [N], float64 [C, n, n]: what neighbours exert on each other, by tension and bending."""
        force = self.stencil(height)
        if self.laplace_stencil is not None and self.rigidity is not None:
            force -= self.laplace_stencil(self.rigidity * self.laplace_stencil(height))
        return force

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s], from the operator's largest eigenvalues.

        A mode with omega^2 = lambda + k and viscous rate mu is stable if dt^2 omega^2 + 2 dt mu <= 4. Infinite if
        nothing moves.
        """
        bound = self.stencil.fastest(self.mass)
        if self.laplace_stencil is not None and self.rigidity is not None:
            bending = self.laplace_stencil.fastest(self.mass)
            bound += bending * float((self.rigidity * self.mass).max()) * bending
        wave = self._rate(self.link_force, bound) + self.stiffness.max()
        viscous = 0.0
        if self.viscous_stencil is not None:
            bound = self.viscous_stencil.fastest(self.mass)
            viscous = self._rate(self.viscous_stencil, bound)
        # the positive root, written so that nothing cancels
        rate = viscous + np.sqrt(viscous**2 + 4 * wave)
        return np.inf if rate == 0 else float(SAFETY * 4 / rate)

    def _rate(self, force: Callable[[NDArray[np.float64]], NDArray[np.float64]], bound: float) -> float:
        """Largest eigenvalue of -M^-1 force, or its bound."""
        return bound if self.bounded else largest_eigenvalue(force, self.mass, self.free, bound)
