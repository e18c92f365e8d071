"""The discrete wave operator: stencil weights, masses, and the largest time step they allow."""

from __future__ import annotations

import dataclasses
import functools

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from .atlas import Atlas
from .errors import SolverError
from .material import Material
from .stencil import EAST, NORTH, agree_across_edges, cotangent_stencil, link_lengths, pad

OPERATORS = ("fem", "paper", "uncorrected", "dynamic-paint")

# Share of the theoretical stability limit that is used: round-off in float32 must not cross it.
SAFETY = 0.98


@dataclasses.dataclass(frozen=True, eq=False)
class WaveOperator:
    """M h_tt = -K h - M zeta h_t - M k h - D h_t on the texels, K and D given by stencils.

    Attributes
    ----------
    stencil : float64 [6, 4, N + 1, N + 1]
        Link weights of K [kg/s^2], see `stencil`.
    viscous_stencil : float64 [6, 4, N + 1, N + 1] or None
        Link weights of D [kg/s]; None without viscosity.
    mass : float64 [6, N, N]
        sigma A [kg].
    damping, stiffness : float64 [6, N, N]
        zeta [1/s] and k [1/s^2].
    """

    stencil: NDArray[np.float64]
    viscous_stencil: NDArray[np.float64] | None
    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s], from the operator's largest eigenvalues.

        A mode with omega^2 = lambda + k and viscous rate mu is stable if dt^2 omega^2 + 2 dt mu <= 4. Infinite if
        nothing moves.
        """
        wave = largest_eigenvalue(self.stencil, self.mass) + self.stiffness.max()
        viscous = 0.0 if self.viscous_stencil is None else largest_eigenvalue(self.viscous_stencil, self.mass)
        if wave == 0:
            return np.inf if viscous == 0 else float(SAFETY * 2 / viscous)
        return float(SAFETY * (np.sqrt(viscous**2 + 4 * wave) - viscous) / wave)


def step_coefficients(operator: WaveOperator, dt: float) -> tuple:
    """Decay, gain [s/kg] and spring [1/s] of the kick v = decay v + gain force - spring h.

    Gain is float32 [6, N, N]; the others are numbers where damping and stiffness are uniform, else of the same shape.
    Damping is implicit (centred): decay = (1 - zeta dt/2) / (1 + zeta dt/2).
    """
    half = operator.damping * (dt / 2)
    decay = (1 - half) / (1 + half)
    spring = dt / (1 + half) * operator.stiffness
    gain = (dt / (1 + half) / operator.mass).astype(np.float32)
    return _uniform(decay), gain, _uniform(spring)


def _uniform(field: NDArray[np.float64]) -> NDArray[np.float32] | np.float32:
    """A number where a field has one value, which saves the kernel's reads; else the field as float32."""
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
    n = atlas.resolution
    speed, damping, stiffness, viscosity, density = (
        material.texels(name, n) for name in ("speed", "damping", "stiffness", "viscosity", "density")
    )
    mass = density * atlas.areas
    if kind == "fem":
        stencil = cotangent_stencil(atlas.positions, density * speed**2)
        viscous = cotangent_stencil(atlas.positions, density * viscosity) if viscosity.any() else None
    else:
        # these formulas give accelerations without masses: one mass for all keeps the units
        mass = np.full_like(mass, mass.mean())
        stencil = _difference_stencil(atlas, mass[0, 0, 0] * speed**2, kind)
        viscous = _difference_stencil(atlas, mass[0, 0, 0] * viscosity, kind) if viscosity.any() else None
    return WaveOperator(stencil, viscous, mass, damping, stiffness)


def _difference_stencil(atlas: Atlas, coefficient: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """Link weights coefficient / distance^2 of the baselines."""
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
    return agree_across_edges(means / lengths**2)


def largest_eigenvalue(stencil: NDArray[np.float64], mass: NDArray[np.float64]) -> float:
    """Upper bound, within about 1 %, of the largest eigenvalue of M^-1 K, by Lanczos iteration.

    Gershgorin's bound, which is always safe, caps the estimate.
    """
    n = mass.shape[1]
    bound = float((_row_sums(np.abs(stencil), n) * 2 / mass).max())
    if bound == 0 or n < 6:
        return bound
    root = np.sqrt(mass)

    def multiply(x: NDArray) -> NDArray:
        return -stencil_sum(stencil, pad(x.reshape(mass.shape) / root)).ravel() / root.ravel()

    size = mass.size
    start = np.random.default_rng(0).standard_normal(size)
    operator = LinearOperator((size, size), matvec=multiply, dtype=np.float64)
    value = eigsh(operator, k=1, which="LA", v0=start, tol=2e-3, return_eigenvectors=False, maxiter=size)
    return min(bound, 1.01 * float(value[0]))


def _row_sums(stencil: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Sum of the links that meet in each texel, [6, N, N]."""
    padded = np.zeros((6, n + 2, n + 2))
    padded[:, 1:-1, 1:-1] = 1
    sums = np.zeros((6, n, n))
    _gather(stencil, padded, sums, 0.0)
    return sums


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
