"""The discrete wave operator: stencil weights, masses, and the largest time step they allow."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.stencil import EAST, NORTH, agree_across_edges, link_lengths, pad, stiffness_stencil

from .material import Material

OPERATORS = ("fem", "paper", "uncorrected", "dynamic-paint")

# Share of the theoretical stability limit that is used: round-off in float32 must not cross it.
SAFETY = 0.99

# No texel may be this much faster (by the sum of its weights over its area) than this share of all texels.
_FASTER, _BULK = 1.2, 0.99


@dataclasses.dataclass(frozen=True, eq=False)
class WaveOperator:
    """M h_tt = -(K + L B L) h - M zeta h_t - M k h - D h_t on the texels; stencils give K, L and D.

    Attributes
    ----------
    stencil : float64 [6, 4, N + 1, N + 1]
        Link weights of K [kg/s^2], see `stencil`.
    mass : float64 [6, N, N]
        sigma A [kg].
    damping, stiffness : float64 [6, N, N]
        zeta [1/s] and k [1/s^2].
    viscous_stencil : float64 [6, 4, N + 1, N + 1] or None
        Link weights of D [kg/s]; None without viscosity.
    laplace_stencil : float64 [6, 4, N + 1, N + 1] or None
        Link weights of L, which gives the area integral of the Laplacian; None without bending.
    rigidity : float64 [6, N, N] or None
        B = sigma b / A [kg/s^2]: L B L is the bi-Laplacian's symmetric form, B L h a plate's moments.
    yield_height : float64 [6, N, N] or None
        [m]; None where everything is elastic.
    fixed : bool [6, N, N]
        Texels that are clamped.
    """

    stencil: NDArray[np.float64]
    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    viscous_stencil: NDArray[np.float64] | None = None
    laplace_stencil: NDArray[np.float64] | None = None
    rigidity: NDArray[np.float64] | None = None
    yield_height: NDArray[np.float64] | None = None
    fixed: NDArray[np.bool_] | None = None

    @functools.cached_property
    def free(self) -> NDArray[np.bool_]:
        """Texels that are not clamped, [6, N, N]."""
        return np.ones(self.mass.shape, bool) if self.fixed is None else ~self.fixed

    @functools.cached_property
    def movable(self) -> NDArray[np.bool_]:
        """Texels that sources may move: free, and with something that pulls back. All, where nothing pulls anywhere."""
        n = self.mass.shape[1]
        pulled = (_row_sums(np.abs(self.stencil), n) > 0) | (self.stiffness > 0)
        if self.rigidity is not None:
            pulled |= self.rigidity > 0
        movable = pulled & self.free
        return movable if movable.any() else self.free

    def elastic_force(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        """-(K + L B L + M k) h [N], float64 [6, N, N]; what holds the clamped texels is left out."""
        return self._tension_force(height) - self.mass * self.stiffness * height

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s], from the operator's largest eigenvalues.

        A mode with omega^2 = lambda + k and viscous rate mu is stable if dt^2 omega^2 + 2 dt mu <= 4. Infinite if
        nothing moves.
        """
        bound = self._rate_bound(self.stencil)
        if self.laplace_stencil is not None and self.rigidity is not None:
            bending = self._rate_bound(self.laplace_stencil)
            bound += bending * float((self.rigidity * self.mass).max()) * bending
        wave = self._largest_eigenvalue(self._tension_force, bound) + self.stiffness.max()
        viscous = 0.0
        if self.viscous_stencil is not None:
            force = functools.partial(_force, self.viscous_stencil)
            viscous = self._largest_eigenvalue(force, self._rate_bound(self.viscous_stencil))
        # the positive root, written so that nothing cancels
        rate = viscous + np.sqrt(viscous**2 + 4 * wave)
        return np.inf if rate == 0 else float(SAFETY * 4 / rate)

    def _tension_force(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        force = _force(self.stencil, height)
        if self.laplace_stencil is not None and self.rigidity is not None:
            force -= _force(self.laplace_stencil, self.rigidity * _force(self.laplace_stencil, height))
        return force

    def _rate_bound(self, stencil: NDArray[np.float64]) -> float:
        """Gershgorin's bound of the largest eigenvalue of M^-1 K."""
        return float((_row_sums(np.abs(stencil), self.mass.shape[1]) * 2 / self.mass).max())

    def _largest_eigenvalue(self, force: Callable[[NDArray[np.float64]], NDArray[np.float64]], bound: float) -> float:
        """Upper bound, within about 0.5 %, of the largest eigenvalue of -M^-1 force, by Lanczos iteration.

        A bound that is always safe caps the estimate.
        """
        if bound == 0 or self.mass.shape[1] < 6:
            return bound
        weight = self.free / np.sqrt(self.mass)

        def multiply(x: NDArray) -> NDArray:
            return -(force(x.reshape(weight.shape) * weight) * weight).ravel()

        size = self.mass.size
        start = np.random.default_rng(0).standard_normal(size)
        matrix = LinearOperator((size, size), matvec=multiply, dtype=np.float64)
        value = eigsh(matrix, k=1, which="LA", v0=start, tol=2e-3, return_eigenvectors=False, maxiter=size)
        return float(np.clip(1.005 * value[0], 0, bound))


@dataclasses.dataclass(frozen=True, eq=False)
class StepCoefficients:
    """The kick of a step dt: v = decay v + gain force - spring h.

    Damping is implicit (centred): decay = (1 - zeta dt/2) / (1 + zeta dt/2).

    Attributes
    ----------
    gain : float32 [6, N, N]
        [s/kg]; 0 where the surface is clamped.
    decay, spring, span : float32 or float32 [6, N, N]
        One number where a coefficient is uniform, which saves the kernel's reads. The spring is in 1/s; the span [s] is
        how long an acceleration that acts everywhere counts: 0 where sources move nothing.
    """

    gain: NDArray[np.float32]
    decay: NDArray[np.float32] | np.float32
    spring: NDArray[np.float32] | np.float32
    span: NDArray[np.float32] | np.float32


def step_coefficients(operator: WaveOperator, dt: float) -> StepCoefficients:
    """Coefficients of the kick of one substep of dt [s]."""
    half = operator.damping * (dt / 2)
    span = dt / (1 + half)
    return StepCoefficients(
        gain=np.where(operator.free, span / operator.mass, 0).astype(np.float32),
        decay=number_or_field((1 - half) / (1 + half)),
        spring=number_or_field(span * operator.stiffness),
        span=number_or_field(span * operator.movable),
    )


def number_or_field(field: NDArray) -> NDArray[np.float32] | np.float32:
    """One float32 number where a field has one value, else the field as float32."""
    first = field.flat[0]
    return np.float32(first) if (field == first).all() else field.astype(np.float32)


def build_operator(atlas: Atlas, material: Material, kind: str) -> WaveOperator:
    """Assemble the operator of a material on an atlas.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    kind : str
        "fem": symmetric, second-order accurate finite elements. The others are baselines for comparison:
        "paper": (c/d)^2 (h_j - h_i) over 4 neighbours at real distances d (Kira, Nakayama, Fujishiro, with the printed
        (d/s)^2 put right); "uncorrected": the same with one mean distance everywhere (their figure 6a);
        "dynamic-paint": the same sum at real distances over 8 neighbours, as Blender's Dynamic Paint takes it.

    Raises
    ------
    SolverError
        For an unknown kind or a material of another resolution.
    """
    if kind not in OPERATORS:
        raise SolverError(f"operator {kind!r} does not exist; valid are {', '.join(map(repr, OPERATORS))}")
    field = {each.name: material.texels(each.name, atlas.resolution) for each in dataclasses.fields(material)}
    density, area = field["density"], atlas.areas
    if kind == "fem":
        assemble = functools.partial(stiffness_stencil, atlas.positions, softening=_softening(atlas))
    else:
        # these formulas give accelerations without masses: one area for all keeps the units, one density as well
        area, density = np.full_like(area, area.mean()), np.full_like(density, density.mean())
        assemble = functools.partial(_difference_stencil, atlas, kind, area[0, 0, 0])
    # what is rigid is not dragged along by its neighbours either
    moves = (field["speed"] > 0) | (field["stiffness"] > 0) | (field["bending"] > 0)
    if moves.any():
        field["viscosity"] *= moves
    viscous, bends, yields = field["viscosity"].any(), field["bending"].any(), np.isfinite(field["yield_height"]).any()
    return WaveOperator(
        stencil=assemble(density * field["speed"] ** 2),
        mass=density * area,
        damping=field["damping"],
        stiffness=field["stiffness"],
        viscous_stencil=assemble(density * field["viscosity"]) if viscous else None,
        laplace_stencil=assemble(np.ones_like(area)) if bends else None,
        rigidity=density * field["bending"] / area if bends else None,
        yield_height=field["yield_height"] if yields else None,
        fixed=field["fixed"] if field["fixed"].any() else None,
    )


def _softening(atlas: Atlas) -> NDArray[np.float64]:
    """Factors that slow those few texels down that would set the time step for all others, [6, N, N].

    Where the texel mesh crosses a crease, single texels are needles. Waves are through them in no time, even slowed
    down. Smooth surfaces that the texels resolve have none: on the sphere all factors are 1.
    """
    stencil = stiffness_stencil(atlas.positions, np.ones_like(atlas.areas))
    rate = _row_sums(np.abs(stencil), atlas.resolution) / atlas.areas
    return np.minimum(1, _FASTER * np.quantile(rate, _BULK) / rate)


def _difference_stencil(atlas: Atlas, kind: str, area: float, coefficient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Link weights area coefficient / distance^2 of the baselines."""
    lengths = link_lengths(atlas.positions)
    if kind != "dynamic-paint":
        lengths[:, [link for link in range(4) if link not in (EAST, NORTH)]] = np.inf
    if kind == "uncorrected":
        finite = np.isfinite(lengths)
        lengths[finite] = lengths[finite].mean()
    lengths[lengths == 0] = np.inf
    c = pad(coefficient)
    low, high = slice(None, -1), slice(1, None)
    means = np.stack(
        [
            (c[:, low, low] + c[:, low, high]) / 2,
            (c[:, low, low] + c[:, high, low]) / 2,
            (c[:, low, low] + c[:, high, high]) / 2,
            (c[:, low, high] + c[:, high, low]) / 2,
        ],
        axis=1,
    )
    return agree_across_edges(area * means / lengths**2)


def _row_sums(stencil: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Sum of the links that meet in each texel, [6, N, N]."""
    padded = np.zeros((6, n + 2, n + 2))
    padded[:, 1:-1, 1:-1] = 1
    sums = np.zeros((6, n, n))
    _gather(stencil, padded, sums, 0.0)
    return sums


def _force(stencil: NDArray[np.float64], field: NDArray[np.float64]) -> NDArray[np.float64]:
    return stencil_sum(stencil, pad(field))


def stencil_sum(stencil: NDArray[np.float64], padded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum over the links of weight (h_j - h_i) at every texel, float64 [6, N, N], of a padded field."""
    n = padded.shape[1] - 2
    result = np.empty((6, n, n))
    _gather(stencil, padded, result, 1.0)
    return result


@numba.njit(cache=True)
def _gather(w, h, out, difference):
    """Sum of weight (h_j - h_i) (difference 1) or of the weights alone (difference 0)."""
    n = out.shape[1]
    neighbours = ((0, 0, 0, 0, 1), (0, 0, -1, 0, -1), (1, 0, 0, 1, 0), (1, -1, 0, -1, 0))
    diagonals = ((2, 0, 0, 1, 1), (2, -1, -1, -1, -1), (3, -1, 0, -1, 1), (3, 0, -1, 1, -1))
    for f in range(6):
        for r in range(1, n + 1):
            for c in range(1, n + 1):
                total = 0.0
                for links in (neighbours, diagonals):
                    for link, i, j, dr, dc in links:
                        weight = w[f, link, r + i, c + j]
                        total += weight * (h[f, r + dr, c + dc] - h[f, r, c]) if difference else weight
                out[f, r - 1, c - 1] = total
