"""The discrete wave operator: stencil weights, masses, and the largest time step they allow."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np

from ..kernel import Bools, Floats, Ints32
from ..texels.stencil import (
    NO_LINKS,
    IrregularLinks,
    Stencil,
    largest_eigenvalue,
)
from ..texels.topology import TexelTopology
from .bending import Bending
from .curvatures import Curvatures
from .mobility import Mobility

# Share of the theoretical stability limit that is used: round-off in float32 must not cross it.
SAFETY = 0.99

# Product of a spring's angular frequency and the longest substep, at most. Leapfrog makes a spring
# swing too fast by a share of (omega dt)^2 / 24, 0.45 %.
_SPRING_PHASE = 0.33


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
        zeta [1/s] and k [1/s^2]; beside the rims of a plate k may be below 0.
    viscosity_stencil : Stencil or None
        Link weights of D [kg/s]; None without viscosity.
    bending : Bending, Curvatures or None
        L and B, or the curvatures of a plate with rims, whose R^T R then stands for L B L; None
        without bending.
    yield_height : float64 [C, n, n] or None
        [m]; None where everything is elastic.
    fixed : bool [C, n, n] or None
        Texels that are clamped.
    rim_links : IrregularLinks
        What a plate's rims give to `stencil`; they and L B L stay as they are at rest where the
        surface moves.
    grip : float64 [C, n, n] or None
        Share of a source that sets a texel in motion, where it is movable; None: 1 everywhere.
    density : float64 [C, n, n] or None
        sigma [kg/m^2], in any unit; None where it is uniform.
    bounded : bool
        Whether the stable step follows from Gershgorin's bound, at once, rather than from the
        eigenvalue itself.
    rest_mobility : Mobility or None
        Mobility of the surface at rest, which stays while the surface moves. None: this operator is
        the one at rest.
    """

    stencil: Stencil
    mass: Floats
    damping: Floats
    stiffness: Floats
    viscosity_stencil: Stencil | None = None
    bending: Bending | Curvatures | None = None
    yield_height: Floats | None = None
    fixed: Bools | None = None
    rim_links: IrregularLinks = NO_LINKS
    grip: Floats | None = None
    density: Floats | None = None
    bounded: bool = False
    rest_mobility: Mobility | None = None

    @property
    def topology(self) -> TexelTopology:
        """How the charts are connected."""
        return self.stencil.topology

    @functools.cached_property
    def mobility(self) -> Mobility:
        """Where sources may move the surface, and the parts into which it falls."""
        if self.rest_mobility is not None:
            return self.rest_mobility
        return Mobility(
            self.stencil, self.stiffness, self.bending, self.fixed, self.grip, self.density
        )

    @property
    def free(self) -> Bools:
        """Texels that are not clamped, [C, n, n]."""
        return self.mobility.free

    @property
    def movable(self) -> Bools:
        """Texels that sources may move, [C, n, n]; see `Mobility`."""
        return self.mobility.movable

    @property
    def anchored(self) -> Bools:
        """Free texels that a link ties to clamped ones, [C, n, n]."""
        return self.mobility.anchored

    @property
    def source_share(self) -> Floats:
        """Share of a source that sets each texel in motion, [C, n, n]."""
        return self.mobility.source_share

    @property
    def inverse_density(self) -> Floats:
        """Greatest density over the density of each texel, [C, n, n]."""
        return self.mobility.inverse_density

    @property
    def response(self) -> Floats:
        """How the surface moves under a pressure that acts everywhere, [C, n, n]."""
        return self.mobility.response

    @property
    def parts(self) -> Ints32 | None:
        """Number of the part to which each texel belongs, [C, n, n]; None for a single part."""
        return self.mobility.parts

    @property
    def keeps_volume(self) -> Bools:
        """Whether each part keeps its volume by default, [p]; see `Mobility`."""
        return self.mobility.keeps_volume

    def moved(
        self,
        stencil: Stencil,
        viscosity_stencil: Stencil | None,
        bending: Bending | Curvatures | None,
    ) -> WaveOperator:
        """The same surface with its texels elsewhere: its masses and its mobility stay."""
        return dataclasses.replace(
            self,
            stencil=stencil,
            viscosity_stencil=viscosity_stencil,
            bending=bending,
            bounded=True,
            rest_mobility=self.mobility,
        )

    def momenta(self, velocity: Floats) -> Floats:
        """Momentum of what moves with the surface [N s], float64 [C, n, n]."""
        return self.mass * velocity

    def elastic_force(self, height: Floats) -> Floats:
        """-(K + L B L + M k) h [N], float64 [C, n, n], without forces that hold clamped texels."""
        return self.link_force(height) - self.mass * self.stiffness * height

    def link_force(self, height: Floats) -> Floats:
        """-(K + L B L) h [N], float64 [C, n, n]: tension and bending between neighbours."""
        force = self.stencil(height)
        if self.bending is not None:
            force += self.bending.force(height)
        return force

    @functools.cached_property
    def rates(self) -> tuple[float, float, float]:
        """Largest rates of links and springs [1/s^2], and of viscosity [1/s].

        Where springs push away, as beside the rims of plates, the rate of the links includes them.
        """
        bound = self.stencil.fastest(self.mass)
        if self.bending is not None:
            bound += self.bending.fastest(self.mass)
        springs = float(self.stiffness.max())
        # plates have such springs beside rims, with links that outweigh them
        if self.stiffness.min() < 0:
            links = self._rate(self.elastic_force, bound + max(springs, 0.0))
            springs = 0.0
        else:
            links = self._rate(self.link_force, bound)
        viscous = 0.0
        if self.viscosity_stencil is not None:
            viscous = self._rate(self.viscosity_stencil, self.viscosity_stencil.fastest(self.mass))
        return links, springs, viscous

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s], from the operator's largest eigenvalues.

        A mode with omega^2 = lambda + k and viscous rate mu is stable if dt^2 omega^2 + 2 dt mu <=
        4. Infinite if nothing moves.
        """
        links, springs, viscous = self.rates
        wave = links if self.stiffness.min() < 0 else self._lightened(links + springs)
        # the positive root, written so that nothing cancels
        rate = viscous + np.sqrt(viscous**2 + 4 * wave)
        return np.inf if rate == 0 else float(SAFETY * 4 / rate)

    @functools.cached_property
    def longest_timestep(self) -> float:
        """Longest substep that is taken [s]: it is stable, and exact enough for the springs.

        Half of the springs swing within 0.5 % of their frequency. Where springs are a large part
        of what limits a stable step, as in a layer a few texels thick, all modes swing nearly as
        fast as the step allows.
        """
        stiffness = float(np.median(self.stiffness[self.movable]))
        if stiffness <= 0:
            return self.stable_timestep
        return min(self.stable_timestep, _SPRING_PHASE / float(np.sqrt(stiffness)))

    def _lightened(self, rate: float) -> float:
        """Greatest squared frequency [1/s^2], with the mass that moves along with the surface."""
        return rate

    def _rate(self, force: Callable[[Floats], Floats], bound: float) -> float:
        """Largest eigenvalue of -M^-1 force, or its bound where the operator is `bounded`."""
        if self.bounded:
            return bound
        return largest_eigenvalue(
            force, self.mass, self.free, bound, loose=isinstance(self.bending, Curvatures)
        )
