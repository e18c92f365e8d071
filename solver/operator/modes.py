"""The modes of a surface: shapes of free vibration, with frequencies and decay times."""

from __future__ import annotations

import numbers
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh, qr
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from ..errors import SolverError, checked, instance, shown
from ..kernel import Bools, Floats
from ..texels.atlas import Atlas
from ..texels.stencil import stiffness_matrix
from .assembly import build_operator
from .deep_water import FluidOperator, factorised
from .material import SHORTEST_TEXELS, Material, warn_of_wavelengths
from .plate_rim import Rim
from .wave_operator import WaveOperator

# Residual of a mode, over its squared frequency, at most. Squared frequencies that differ by a
# smaller share count as one.
_MAX_RESIDUAL = 1e-9

# Squared frequencies below this share of the mean squared frequency of all texels are round-off.
_MIN_SQUARE_SHARE = 1e-13

# Share of the damping that is added to the stiffness, over the mean of both, so that modes of one
# frequency are those that the damping does not mix.
_DAMPING_SHARE = 1e-6

# A mode counts as linear in the place if its misfit to a linear function is less than this share.
_MAX_LINEAR_MISFIT = 0.1

# Pull on a mode, over the pull of bending on a wave of its length, below which nothing pulls the
# mode back.
_MIN_PULL_SHARE = 0.01


class Modes(NamedTuple):
    """Modes of a surface, in ascending order of their frequencies without damping; see `modes`.

    Attributes
    ----------
    frequencies : float64 [count]
        [Hz]; 0 where a mode is damped so much that it creeps back.
    shapes : float64 [count, C, n, n]
        Heights, 1 where they are largest.
    decay_times : float64 [count]
        Time in which a mode falls to 1/e [s]; infinite without damping.
    """

    frequencies: Floats
    shapes: Floats
    decay_times: Floats


@checked(
    SolverError,
    atlas=instance(Atlas, ", from build_atlas or sphere_atlas"),
    material=instance(Material, ", for instance Material(speed=1.0)"),
)
def modes(atlas: Atlas, material: Material, count: int = 20, *, rim: Rim = "free") -> Modes:
    """Find the lowest modes of a surface, under the operator with which `WaveSolver` steps.

    Motions that nothing pulls back are left out, such as those of a free membrane or plate as a
    whole. A solver that conserves volume does not excite modes that change it. Heights are small:
    there are no dents. Damping that varies over the surface counts to first order. All modes of one
    frequency are found, of which symmetric shapes and equal parts have several.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    count : int
        Number of modes.
    rim : str
        See `WaveSolver`.

    Raises
    ------
    SolverError
        If the count is not a whole number from 1 up to the modes whose waves are of six texels and
        more, about a twelfth of the texels that move; for an invalid rim, a material of another
        resolution, or deep fluid below a surface that is held or uneven.
    """
    warn_of_wavelengths(atlas, material)
    operator = build_operator(atlas, material, "fem", rim)
    # not from the operator's stiffness, which links outweigh beside the rims of a plate
    matrix = elastic_matrix(operator)
    weight = operator.mass.ravel()
    least_square = float(np.min(material.stiffness))  # squared frequency [1/s^2]
    elastic = matrix
    moving = np.flatnonzero(operator.free.ravel() & (matrix.diagonal() > 0))
    max_count = int(np.pi * len(moving) / SHORTEST_TEXELS**2)  # by Weyl's law
    if not (isinstance(count, numbers.Integral) and 1 <= count <= max_count):
        raise SolverError(
            f"count of modes must be a whole number from 1 to {max_count}, got {shown(count)}: of "
            f"{len(moving):,} texels that move, further modes have waves of fewer than "
            f"{SHORTEST_TEXELS:g}; take a finer atlas for more"
        )
    if isinstance(operator, FluidOperator):
        # on an even surface water has the modes of the Laplacian, which keep its volume
        uneven = np.ptp(material.speed) or np.ptp(operator.stiffness)
        if operator.topology.fixed_rim or not operator.free.all() or uneven:
            raise SolverError(
                "modes of deep fluid are known with a free rim, no clamp, one speed and stiffness "
                "alone"
            )
        matrix = stiffness_matrix(operator.geometry)
        weight = operator.areas.ravel()
        least_square = 0.0
    tilts = 0 if operator.bending is None else 2  # of a flat plate, at most
    vectors = _lowest(matrix[moving][:, moving], weight[moving], least_square, int(count) + tilts)
    heights = np.zeros((vectors.shape[1], operator.mass.size))
    heights[:, moving] = vectors.T
    if tilts:
        is_tilt = _are_tilts(atlas, material, elastic, operator.mass.ravel(), heights)
        heights = heights[~is_tilt][: int(count)]
    return _ringing(operator, elastic, heights)


def elastic_matrix(operator: WaveOperator) -> csr_array:
    """K + L B L + M k as a matrix [T, T] [kg/s^2].

    Its product with a height is minus the `elastic_force` of the operator.
    """
    springs = diags_array((operator.mass * operator.stiffness).ravel())
    matrix = stiffness_matrix(operator.stencil) + springs
    if operator.bending is not None:
        matrix = matrix + operator.bending.stiffness
    return csr_array(matrix)


def _are_tilts(
    atlas: Atlas, material: Material, elastic: csr_array, mass: Floats, heights: Floats
) -> Bools:
    """Which of some heights [m, T] move a flat plate as if it were rigid, [m].

    Such heights are linear in the place. They are pulled back by no more than a hundredth of the
    pull that bending has on waves of their length, from the operator's errors at rims. Membranes,
    and plates that are curved or held, do pull back linear heights.

    `elastic` is that of `elastic_matrix`.
    """
    areas = atlas.areas.ravel()
    linear = np.column_stack([np.ones(areas.size), atlas.positions.reshape(-1, 3)])
    misfit = heights.T - linear @ np.linalg.lstsq(linear, heights.T)[0]
    is_linear = np.linalg.norm(misfit, axis=0) < _MAX_LINEAR_MISFIT * np.linalg.norm(
        heights, axis=1
    )
    squared_frequencies = _quotients(heights, elastic, mass)
    squared_wave_numbers = _quotients(heights, atlas.stiffness(), areas)
    bending = material.texels("bending", atlas.areas.shape).mean()
    return is_linear & (squared_frequencies < _MIN_PULL_SHARE * bending * squared_wave_numbers**2)


def _quotients(heights: Floats, matrix: csr_array, weight: Floats) -> Floats:
    """Rayleigh quotients [m] of heights [m, T], with a matrix [T, T] over a weight [T]."""
    energies: Floats = np.einsum("mt,tm->m", heights, matrix @ heights.T)
    return energies / (heights**2 @ weight)


def _lowest(stiffness: csr_array, mass: Floats, least_square: float, count: int) -> Floats:
    """Vectors [k, count] of the lowest modes that are not rigid.

    No squared frequency is below `least_square` [1/s^2]. Shift-invert Lanczos (Ericsson and Ruhe
    1980) finds, except for round-off, one vector of each frequency. So it runs again in the
    complement of all vectors that are found, until nothing lower remains there: no mode of several
    with one frequency is missed.
    """
    size = len(mass)
    # in units of the roots of the masses the modes are eigenvectors of one symmetric matrix
    inverse_roots = diags_array(1 / np.sqrt(mass))
    matrix = csr_array(inverse_roots @ stiffness @ inverse_roots)
    mean = float(matrix.diagonal().mean())
    # below the lowest mode, whose square is about mean / size for a membrane, mean / size^2 for a
    # plate
    margin = max((mean - least_square) / size**2, _MAX_RESIDUAL * mean)
    shift = least_square - margin
    solve = factorised(matrix - shift * diags_array(np.ones(size)))
    generator = np.random.default_rng(0)
    basis = np.empty((size, 0))
    squares = np.empty(0)
    vectors_to_find = count + 2

    def inverse(x: Floats) -> Floats:
        y = solve(x)
        return y - basis @ (basis.T @ y)

    lanczos = LinearOperator((size, size), inverse, dtype=np.float64)
    while True:
        start = generator.standard_normal(size)
        values, new = eigsh(
            matrix,
            min(vectors_to_find, size - 1),
            sigma=shift,
            OPinv=lanczos,
            v0=start,
            tol=_MAX_RESIDUAL,
        )
        rigid = int((squares < _MIN_SQUARE_SHARE * mean).sum())
        has_enough = len(squares) >= rigid + count
        if has_enough and values.min() >= (1 - _MAX_RESIDUAL) * squares[rigid + count - 1]:
            return inverse_roots @ basis[:, rigid : rigid + count]
        joined = qr(np.column_stack([basis, new]), mode="economic")[0]
        squares, mixed = eigh(joined.T @ (matrix @ joined))
        basis = joined @ mixed
        vectors_to_find = 2 + count // 4


def _ringing(operator: WaveOperator, elastic: csr_array, heights: Floats) -> Modes:
    """Modes in the space of some heights [count, T]; for `elastic` see `elastic_matrix`."""
    shape = (len(heights), *operator.mass.shape)
    momenta = np.empty(shape)
    drag = np.empty(shape)
    for k, height in enumerate(heights.reshape(shape)):
        momenta[k] = operator.momenta(height)
        drag[k] = operator.damping * height
        if operator.viscosity_stencil is not None:
            drag[k] -= operator.viscosity_stencil(height) / operator.mass
    momenta = momenta.reshape(heights.shape)
    pull = heights @ (elastic @ heights.T)
    inertia = momenta @ heights.T
    loss = momenta @ drag.reshape(heights.shape).T
    # of modes of one frequency those that the damping does not mix
    damping = _DAMPING_SHARE * np.trace(pull) / np.trace(loss) * loss if loss.any() else 0.0
    separated = pull + damping
    mixed = eigh((separated + separated.T) / 2, (inertia + inertia.T) / 2)[1]
    squares: Floats = np.einsum("im,ij,jm->m", mixed, pull, mixed)
    rates: Floats = np.einsum("im,ij,jm->m", mixed, loss, mixed)
    order = np.argsort(squares, kind="stable")
    squares = squares[order]
    half = np.maximum(rates[order], 0.0) / 2
    heights = (mixed.T @ heights)[order]
    # the roots of s^2 + 2 half s + square: where both are real, the slower one remains
    creep = np.sqrt(np.maximum(half**2 - squares, 0.0))
    with np.errstate(divide="ignore"):
        decay_times = np.where(creep > 0, (half + creep) / squares, 1 / half)
    peaks = heights[np.arange(len(heights)), np.abs(heights).argmax(axis=1)]
    shapes = (heights / peaks[:, None]).reshape(shape)
    frequencies = np.sqrt(np.maximum(squares - half**2, 0.0)) / (2 * np.pi)
    return Modes(frequencies, shapes, decay_times)
