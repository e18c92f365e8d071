"""How a surface rings: the modes of its wave operator, with their frequencies and how fast they die."""

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

# Residual of a mode, as a share of it; squared frequencies that differ by a smaller share are the
# same.
_RESIDUAL = 1e-9

# Squared frequencies below this share of the mean one of all that the texels have are round-off.
_NOTHING = 1e-13

# Of the damping counts so much as stiffness, over the mean of both, where modes of one frequency
# are told apart.
_PART = 1e-6


class Modes(NamedTuple):
    """Modes of a surface, in ascending order of what their frequencies are without damping; see `modes`.

    Attributes
    ----------
    frequencies : float64 [count]
        [Hz]; 0 where a mode is damped so much that it creeps back.
    shapes : float64 [count, C, n, n]
        Heights, 1 where they are largest.
    decay_times : float64 [count]
        In which they fall to 1/e [s]; infinite without damping.
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
    """Find the lowest modes of a surface: how it swings by itself under the operator that `WaveSolver` steps with.

    Motions that nothing pulls back, as of a free membrane or plate on the whole, are left out. A
    solver that conserves volume does not excite modes that change it. Heights are small: there are
    no dents. Damping that varies over the surface counts to first order. Modes of one frequency, as
    symmetric shapes and equal parts have them, are all there.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    count : int
        How many.
    rim : str
        As of `WaveSolver`.

    Raises
    ------
    SolverError
        If the count is not a whole number from 1 up to the modes whose waves are of six texels and
        more, about a twelfth of the texels that move; for an invalid rim, a material of another
        resolution, or deep fluid below a surface that is held or uneven.
    """
    warn_of_wavelengths(atlas, material)
    operator = build_operator(atlas, material, "fem", rim)
    # not of the operator's stiffness, which links outweigh beside the rims of a plate
    matrix = elastic_matrix(operator)
    weight = operator.mass.ravel()
    least = float(np.min(material.stiffness))
    elastic = matrix
    moving = np.flatnonzero(operator.free.ravel() & (matrix.diagonal() > 0))
    most = int(np.pi * len(moving) / SHORTEST_TEXELS**2)  # by Weyl's law
    if not (isinstance(count, numbers.Integral) and 1 <= count <= most):
        raise SolverError(
            f"count of modes is {shown(count)}; valid is a whole number from 1 to {most}: of "
            f"{len(moving):,} texels "
            f"that move, further modes have waves of fewer than {SHORTEST_TEXELS:g}; take a finer "
            f"atlas for more"
        )
    if isinstance(operator, FluidOperator):
        # where all is even, water has the modes of the Laplacian, which keep its volume
        uneven = np.ptp(material.speed) or np.ptp(operator.stiffness)
        if operator.topology.fixed_rim or not operator.free.all() or uneven:
            raise SolverError(
                "modes of deep fluid are known with a free rim, no clamp, one speed and stiffness "
                "alone"
            )
        matrix = stiffness_matrix(operator.geometry)
        weight = operator.areas.ravel()
        least = 0.0
    tilts = 0 if operator.bending is None else 2
    vectors = _lowest(matrix[moving][:, moving], weight[moving], least, int(count) + tilts)
    heights = np.zeros((vectors.shape[1], operator.mass.size))
    heights[:, moving] = vectors.T
    if tilts:
        heights = heights[~_are_tilts(atlas, material, elastic, operator.mass.ravel(), heights)][
            : int(count)
        ]
    return _ringing(operator, elastic, heights)


def elastic_matrix(operator: WaveOperator) -> csr_array:
    """K + L B L + M k as a matrix [T, T] [kg/s^2], whose product with a height is minus `elastic_force`."""
    matrix = stiffness_matrix(operator.stencil) + diags_array(
        (operator.mass * operator.stiffness).ravel()
    )
    if operator.bending is not None:
        matrix = matrix + operator.bending.stiffness
    return csr_array(matrix)


def _are_tilts(
    atlas: Atlas, material: Material, elastic: csr_array, mass: Floats, heights: Floats
) -> Bools:
    """Which of some heights [m, T] move a flat plate as if it were rigid, [m]; see `elastic_matrix`.

    They are linear in the place, and pulled back by no more than a hundredth of what bends waves of
    their length: the operator is as good as blind to them, but for its errors at rims. Membranes,
    and plates that are curved or held, do pull back what is linear.
    """
    areas = atlas.areas.ravel()
    linear = np.column_stack([np.ones(areas.size), atlas.positions.reshape(-1, 3)])
    left = heights.T - linear @ np.linalg.lstsq(linear, heights.T)[0]
    squares, numbers = (
        np.einsum("mt,tm->m", heights, matrix @ heights.T) / (heights**2 @ weight)
        for matrix, weight in ((elastic, mass), (atlas.stiffness(), areas))
    )
    is_linear = np.linalg.norm(left, axis=0) < 0.1 * np.linalg.norm(heights, axis=1)
    bending = material.texels("bending", atlas.areas.shape).mean()
    return is_linear & (squares < 0.01 * bending * numbers**2)


def _lowest(stiffness: csr_array, mass: Floats, least: float, count: int) -> Floats:
    """Vectors [k, count] of the lowest modes that are not rigid; no squared frequency is below `least`.

    Shift-invert Lanczos (Ericsson and Ruhe 1980) sees, but for round-off, one vector of each
    frequency. So it runs again in the complement of all that were found, until nothing lower is
    left there: no copy is missed.
    """
    size = len(mass)
    light = diags_array(1 / np.sqrt(mass))
    matrix = csr_array(light @ stiffness @ light)
    mean = float(matrix.diagonal().mean())
    # below the lowest mode: that is about mean / size of a membrane, mean / size^2 of a plate
    shift = least - max((mean - least) / size**2, _RESIDUAL * mean)
    solve = factorised(matrix - shift * diags_array(np.ones(size)))
    random = np.random.default_rng(0)
    found = np.empty((size, 0))
    squares = np.empty(0)
    asked = count + 2

    def inverse(x: Floats) -> Floats:
        y = solve(x)
        return y - found @ (found.T @ y)

    lanczos = LinearOperator((size, size), inverse, dtype=np.float64)
    while True:
        start = random.standard_normal(size)
        values, new = eigsh(
            matrix, min(asked, size - 1), sigma=shift, OPinv=lanczos, v0=start, tol=_RESIDUAL
        )
        rigid = int((squares < _NOTHING * mean).sum())
        if (
            len(squares) >= rigid + count
            and values.min() >= (1 - _RESIDUAL) * squares[rigid + count - 1]
        ):
            return light @ found[:, rigid : rigid + count]
        basis = qr(np.column_stack([found, new]), mode="economic")[0]
        squares, mixed = eigh(basis.T @ (matrix @ basis))
        found = basis @ mixed
        asked = 2 + count // 4


def _ringing(operator: WaveOperator, elastic: csr_array, heights: Floats) -> Modes:
    """Modes of heights [count, T] that swing by themselves; see `elastic_matrix`."""
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
    # of those of one frequency the ones that the damping does not mix
    told_apart = pull + (_PART * np.trace(pull) / np.trace(loss) * loss if loss.any() else 0.0)
    mixed = eigh((told_apart + told_apart.T) / 2, (inertia + inertia.T) / 2)[1]
    squares, rates = (np.einsum("im,ij,jm->m", mixed, each, mixed) for each in (pull, loss))
    order = np.argsort(squares, kind="stable")
    squares = squares[order]
    half = np.maximum(rates[order], 0.0) / 2
    heights = (mixed.T @ heights)[order]
    # the roots of s^2 + 2 half s + square: where both are real, the slower one is what is left
    creep = np.sqrt(np.maximum(half**2 - squares, 0.0))
    with np.errstate(divide="ignore"):
        decay_times = np.where(creep > 0, (half + creep) / squares, 1 / half)
    peaks = heights[np.arange(len(heights)), np.abs(heights).argmax(axis=1)]
    shapes = (heights / peaks[:, None]).reshape(shape)
    return Modes(np.sqrt(np.maximum(squares - half**2, 0.0)) / (2 * np.pi), shapes, decay_times)
