"""The discrete wave operator: stencil weights, masses, the largest time step they allow, and what a substep needs.

The surface falls into parts that float freely: each has a mean height of its own that nothing pulls
back.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from ..errors import SolverError
from ..kernel import Bools, Floats, Floats32, Ints, Ints32
from ..mesh.topology import labels
from ..texels.stencil import (
    NO_LINKS,
    IrregularLinks,
    Stencil,
    largest_eigenvalue,
    link_exists,
    stiffness_matrix,
)
from ..texels.topology import TexelTopology
from .curvatures import Curvatures

# Share of the theoretical stability limit that is used: round-off in float32 must not cross it.
SAFETY = 0.99

# Square root of the stiffness times the longest substep: leapfrog makes a swing (omega dt)^2 / 24
# too fast, 0.45 %.
_SWING = 0.33


def _joins_neighbours(stencil: Stencil) -> bool:
    """Whether the sides of all quads are links, so that every part of the mesh is one."""
    topology = stencil.topology
    return all(stencil.weights[:, link][link_exists(topology, link)].all() for link in range(2))


class Bending(NamedTuple):
    """L B L, the bi-Laplacian's symmetric form; B L h are a plate's moments.

    Attributes
    ----------
    laplace : Stencil
        Link weights of L, which gives the area integral of the Laplacian.
    rigidity : float64 [C, n, n]
        B = sigma b / A [kg/s^2].
    """

    laplace: Stencil
    rigidity: Floats

    def force(self, height: Floats) -> Floats:
        """-L B L h [N], float64 [C, n, n]."""
        return -self.laplace(self.rigidity * self.laplace(height))

    @property
    def stiffness(self) -> csr_array:
        """L B L [N/m], [T, T]."""
        laplace = stiffness_matrix(self.laplace)
        return csr_array(laplace @ diags_array(self.rigidity.ravel()) @ laplace)

    def fastest(self, mass: Floats) -> float:
        """Bound of the largest eigenvalue over a lumped mass [C, n, n]."""
        rate = self.laplace.fastest(mass)
        return rate * float((self.rigidity * mass).max()) * rate

    def ties(self, free: Bools) -> Bools:
        """Texels that bend together with one that is not free, [C, n, n]."""
        return self.laplace(free.astype(np.float64)) != 0

    @property
    def joins_all(self) -> bool:
        """Whether all texels of a part of the mesh bend together."""
        return bool((self.rigidity > 0).all()) and _joins_neighbours(self.laplace)

    @property
    def graph(self) -> csr_array:
        """Texels that are joined, [T, T]; not symmetric."""
        stiff = (self.rigidity.reshape(-1, 1) > 0).astype(np.float64)
        return csr_array(abs(stiffness_matrix(self.laplace)).multiply(stiff))


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

    @property
    def topology(self) -> TexelTopology:
        """How the charts are connected."""
        return self.stencil.topology

    @functools.cached_property
    def free(self) -> Bools:
        """Texels that are not clamped, [C, n, n]."""
        return np.ones(self.mass.shape, bool) if self.fixed is None else ~self.fixed

    @functools.cached_property
    def movable(self) -> Bools:
        """Texels that sources may move: free, and with something that pulls back.

        All, where nothing pulls anywhere.
        """
        pulled = (self.stencil.absolute_sums() > 0) | (self.stiffness > 0)
        if self.bending is not None:
            pulled |= self.bending.rigidity > 0
        movable = pulled & self.free
        return movable if movable.any() else self.free

    @functools.cached_property
    def anchored(self) -> Bools:
        """Free texels that a link ties to what is clamped, [C, n, n]."""
        tied = self.stencil(self.free.astype(np.float64)) != 0
        if self.bending is not None:
            tied |= self.bending.ties(self.free)
        return tied & self.free

    @functools.cached_property
    def source_share(self) -> Floats:
        """Share of a source that sets each texel in motion, [C, n, n]; what lies below the surface takes the rest."""
        return np.where(self.movable, 1.0 if self.grip is None else self.grip, 0.0)

    @functools.cached_property
    def inverse_density(self) -> Floats:
        """Greatest density over that of each texel, [C, n, n]: how much more a pressure moves it."""
        return (
            np.ones(self.mass.shape) if self.density is None else self.density.max() / self.density
        )

    @functools.cached_property
    def response(self) -> Floats:
        """How the surface moves under a pressure that acts everywhere, [C, n, n]; 1 where all of it is alike."""
        return self.source_share * self.inverse_density

    @functools.cached_property
    def parts(self) -> Ints32 | None:
        """Number of the freely floating part to which each texel belongs, [C, n, n]; None where there is one part only.

        Texels belong together where something joins them. Of each of the mesh's own parts, all
        those that a spring or a clamp holds count as one, however zero wave speeds cut them up:
        what holds them brings them back to where they were. Those that are not movable are rigid,
        and belong to any part.
        """
        topology = self.topology
        of_chart = self._part_of_chart
        if _joins_neighbours(self.stencil) or (self.bending is not None and self.bending.joins_all):
            charts = np.broadcast_to(of_chart[:, None, None], topology.shape)
            return np.ascontiguousarray(charts, np.int32) if of_chart.any() else None
        graph = abs(stiffness_matrix(self.stencil))
        if self.bending is not None:
            graph = csr_array(graph + self.bending.graph)
        graph.eliminate_zeros()
        part = connected_components(graph, directed=False)[1].astype(np.int64)
        is_held = np.bincount(part, ((self.stiffness > 0) | self.anchored).reshape(-1)) > 0
        # those that are held bear the number of their part of the mesh, after all others
        of_texel = np.repeat(of_chart, topology.texel_count // len(of_chart))
        part = np.where(is_held[part], part.max() + 1 + of_texel, part)
        moves = self.movable.reshape(-1)
        names, number = np.unique(part[moves], return_inverse=True)
        if len(names) <= 1:
            return None
        # rigid texels do not break up a chart
        part[:] = -1
        part[moves] = number
        charts = part.reshape(len(of_chart), -1)
        filled = np.where(charts < 0, charts.max(axis=1, keepdims=True).clip(0), charts)
        return filled.astype(np.int32).reshape(topology.shape)

    @functools.cached_property
    def keeps_volume(self) -> Bools:
        """Whether each part keeps its volume unless told otherwise, [p]: it is closed, or nothing holds it.

        A closed surface is as that of an incompressible body, whatever springs or clamps it has. An
        open one encloses nothing. Its mean height is kept where nothing else would stop it: no rim,
        clamp or spring.
        """
        part = np.zeros(self.mass.shape, np.int32) if self.parts is None else self.parts
        is_open_chart = (self.topology.glued[..., 0] < 0).any(axis=1)
        is_open = np.bincount(self._part_of_chart, is_open_chart) > 0
        open_texels = is_open[self._part_of_chart][:, None, None] & self.movable
        held_texels = ((self.stiffness > 0) | self.anchored) & self.movable
        opens, held = (
            np.bincount(part.reshape(-1), each.reshape(-1)) > 0
            for each in (open_texels, held_texels)
        )
        return ~(opens & held)

    @functools.cached_property
    def _part_of_chart(self) -> Ints:
        """Part of the mesh to which each chart belongs, [C], from 0."""
        glued = self.topology.glued
        chart, side = np.nonzero(glued[..., 0] >= 0)
        return labels(np.stack([chart, glued[chart, side, 0]], axis=1), len(glued))

    def moved(
        self,
        stencil: Stencil,
        viscosity_stencil: Stencil | None,
        bending: Bending | Curvatures | None,
    ) -> WaveOperator:
        """The same surface with its texels elsewhere: masses, and what holds or parts it, stay."""
        moved = dataclasses.replace(
            self,
            stencil=stencil,
            viscosity_stencil=viscosity_stencil,
            bending=bending,
            bounded=True,
        )
        kept = (
            "free",
            "movable",
            "anchored",
            "source_share",
            "inverse_density",
            "response",
            "parts",
            "keeps_volume",
        )
        for name in kept:
            object.__setattr__(moved, name, getattr(self, name))
        return moved

    def momenta(self, velocity: Floats) -> Floats:
        """Momentum of what moves with the surface [N s], float64 [C, n, n]."""
        return self.mass * velocity

    def elastic_force(self, height: Floats) -> Floats:
        """-(K + L B L + M k) h [N], float64 [C, n, n]; what holds the clamped texels is left out."""
        return self.link_force(height) - self.mass * self.stiffness * height

    def link_force(self, height: Floats) -> Floats:
        """-(K + L B L) h [N], float64 [C, n, n]: what neighbours exert on each other, by tension and bending."""
        force = self.stencil(height)
        if self.bending is not None:
            force += self.bending.force(height)
        return force

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s], from the operator's largest eigenvalues.

        A mode with omega^2 = lambda + k and viscous rate mu is stable if dt^2 omega^2 + 2 dt mu <=
        4. Infinite if nothing moves.
        """
        bound = self.stencil.fastest(self.mass)
        if self.bending is not None:
            bound += self.bending.fastest(self.mass)
        # as plates have them beside rims, with links that outweigh them
        if self.stiffness.min() < 0:
            wave = self._rate(self.elastic_force, bound + max(self.stiffness.max(), 0.0))
        else:
            wave = self._lightened(self._rate(self.link_force, bound) + self.stiffness.max())
        viscous = 0.0
        if self.viscosity_stencil is not None:
            viscous = self._rate(self.viscosity_stencil, self.viscosity_stencil.fastest(self.mass))
        # the positive root, written so that nothing cancels
        rate = viscous + np.sqrt(viscous**2 + 4 * wave)
        return np.inf if rate == 0 else float(SAFETY * 4 / rate)

    @functools.cached_property
    def longest_timestep(self) -> float:
        """Longest substep that is taken [s]: it is stable, and half of the springs swing within 0.5 % of their rate.

        Where springs are a large part of what limits a stable step, as in a layer a few texels
        thick, all modes swing nearly as fast as it allows.
        """
        stiffness = float(np.median(self.stiffness[self.movable]))
        if stiffness <= 0:
            return self.stable_timestep
        return min(self.stable_timestep, _SWING / float(np.sqrt(stiffness)))

    def _lightened(self, rate: float) -> float:
        """What a squared frequency is at most, whatever moves with the surface."""
        return rate

    def _rate(self, force: Callable[[Floats], Floats], bound: float) -> float:
        """Largest eigenvalue of -M^-1 force, or its bound."""
        if self.bounded:
            return bound
        return largest_eigenvalue(
            force, self.mass, self.free, bound, loose=isinstance(self.bending, Curvatures)
        )


@dataclasses.dataclass(frozen=True, eq=False)
class StepCoefficients:
    """The kick of a step dt: v = decay v + gain force - spring h.

    Damping is implicit (centred): decay = (1 - zeta dt/2) / (1 + zeta dt/2), and 0 where that would
    be negative, zeta dt > 2: the velocity is then what the forces sustain against the damping, and
    does not change its sign each substep.

    Attributes
    ----------
    gain : float32 [C, n, n]
        [s/kg]; 0 where the surface is clamped.
    decay, spring, span : float32 or float32 [C, n, n]
        One number where a coefficient is uniform, which saves the kernel's reads. The spring is in
        1/s; the span [s] is how long the acceleration of a pressure that acts everywhere counts: 0
        where sources move nothing.
    """

    gain: Floats32
    decay: Floats32 | np.float32
    spring: Floats32 | np.float32
    span: Floats32 | np.float32


def step_coefficients(operator: WaveOperator, dt: float) -> StepCoefficients:
    """Coefficients of the kick of one substep of dt [s].

    Raises
    ------
    SolverError
        If float32 cannot hold one of them.
    """
    decay, span = damped_step(operator, dt)
    with np.errstate(over="ignore"):
        kick = StepCoefficients(
            gain=np.where(operator.free, span / operator.mass, 0).astype(np.float32),
            decay=number_or_field(decay),
            spring=number_or_field(span * operator.stiffness),
            span=number_or_field(span * operator.response),
        )
    if not all(np.isfinite(value).all() for value in (kick.gain, kick.spring, kick.span)):
        raise SolverError(
            f"a substep of {dt:.4g} s on texels of {operator.mass.min():.4g} kg and more is beyond "
            f"float32; valid is a "
            "shorter step, or a larger mesh or material density"
        )
    return kick


def damped_step(operator: WaveOperator, dt: float) -> tuple[Floats, Floats]:
    """Decay of the velocity over a substep of dt [s], and how long a force counts [s], each [C, n, n]."""
    half = operator.damping * (dt / 2)
    return np.maximum((1 - half) / (1 + half), 0), dt / (1 + np.maximum(half, 2 * half - 1))


def number_or_field(field: NDArray) -> Floats32 | np.float32:
    """One float32 number where a field has one value, else the field as float32."""
    first = field.flat[0]
    return np.float32(first) if (field == first).all() else field.astype(np.float32)
