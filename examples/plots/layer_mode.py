"""Exact waves over an incompressible layer on a rigid base, which `Material.layer` is a fit to.

    python examples/plots/layer_mode.py

prints the errors of its phase and group speed. Shear modulus, density and thickness are 1 here, so
that frequencies are in c_T / d and wave numbers in 1 / d.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from ripple_sim.solver import Material
from ripple_sim.solver.operator import frequency


def lowest_square(q: float) -> float:
    """Square of the angular frequency of the lowest normal mode, of a wave number from 1 to 40."""
    # the determinant is 0 at 0 as well, where s is q
    squares = np.linspace(max(1.0, 0.8 * q**2), q**2 + 20.0, 100)
    signs = np.sign([determinant(q, square) for square in squares])
    first = int(np.flatnonzero(np.diff(signs) != 0)[0])
    return float(
        brentq(
            lambda square: determinant(q, square), squares[first], squares[first + 1], xtol=1e-12
        )
    )


def group_speed(q: float) -> float:
    """Speed of a group of waves, the slope of the frequency."""
    above, below = (np.sqrt(lowest_square(q + step)) for step in (1e-3, -1e-3))
    return float((above - below) / 2e-3)


def moving_mass(q: float) -> float:
    """Mass that moves as the surface does, over that of the layer: the mode's kinetic energy."""
    rates, tops, rows = conditions(q, lowest_square(q))
    z = np.linspace(0, 1, 401)[:, None]
    # columns of one size; the last singular vector is the mode
    sizes = np.abs(rows).max(axis=0)
    mode = np.linalg.svd(rows / sizes)[2][-1].conj() / sizes
    waves = mode * np.exp(rates * z - tops)
    across = waves.sum(axis=1)
    along = (rates * waves).sum(axis=1) / q
    energy = np.abs(across) ** 2 + np.abs(along) ** 2
    return float(np.trapezoid(energy, z[:, 0]) / np.abs(across[-1]) ** 2)


def determinant(q: float, square: float) -> float:
    """Residual of the conditions: 0 where a wave number and a squared frequency are a mode."""
    rates, _, rows = conditions(q, square)
    s = rates[2]
    return float((np.linalg.det(rows) / s * np.exp(1j * s.imag)).real)


def conditions(q: float, square: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The conditions of the lowest modes: no motion at the base, no stress at the surface.

    The normal displacement is a sum of exp(r z - t) with rates r of q and -q, which carry the
    pressure, and of s and -s with s^2 = q^2 - omega^2, which do not; t keeps each within 1. The
    tangential one follows, since the volume is kept. Returns r, t and the rows.
    """
    s = np.sqrt(complex(q**2 - square, 1e-30))
    rates = np.array([q, -q, s, -s])
    tops = np.array([q, 0, s, 0])
    base = np.exp(-tops)
    surface = np.exp(rates - tops)
    pressure = square * np.array([1 / q, -1 / q, 0, 0])
    rows = np.array(
        [base, rates * base, (rates**2 + q**2) * surface, (2 * rates - pressure) * surface]
    )
    return rates, tops, rows


def main() -> None:
    for short, wave_numbers in ((False, np.linspace(1.3, 8, 68)), (True, np.geomspace(5, 40, 60))):
        material = Material.layer(1.0, 0.0, 1.0, 1.0, short=short)
        step = 1e-3
        ours = np.array(
            [[frequency(material, q + d) for d in (-step, 0, step)] for q in wave_numbers]
        )
        exact = np.sqrt([lowest_square(q) for q in wave_numbers])
        phase = ours[:, 1] / exact - 1
        group = (ours[:, 2] - ours[:, 0]) / (2 * step) / [group_speed(q) for q in wave_numbers] - 1
        worst = wave_numbers[np.abs(group).argmax()]
        mass = [moving_mass(q) for q in wave_numbers]
        print(
            f"short={short}, q d from {wave_numbers[0]:g} to {wave_numbers[-1]:g}: phase within "
            f"{np.abs(phase).max():.1%}, group within {np.abs(group).max():.1%} (at {worst:.1f}); "
            f"mass {min(mass):.2f} to {max(mass):.2f}"
        )
    three_fields()


def three_fields() -> None:
    """Fits of a local law with two hidden fields, the smallest that has both wave speeds.

    The faster the hidden waves may run, the closer is the best fit.
    """
    wave_numbers = np.linspace(1.3, 8, 68)
    step = 1e-3
    exact = np.sqrt([lowest_square(q) for q in wave_numbers])
    exact_group = np.array([group_speed(q) for q in wave_numbers])
    fits = (
        ((0.9307, 4.0, 4.0), (21.911, 16.703, 8.155), (4.5874, 7.4256), 8.485),
        ((0.9872, 2.5, 2.5), (9.889, 37.315, 9.041), (4.9078, 3.0892), 13.733),
        ((0.8412, 1.5, 1.5), (6.109, 11.063, 79.987), (1.6699, 4.8775), 24.313),
    )
    for fit in fits:
        below, at, above = (three_field_frequency(wave_numbers + d, *fit) for d in (-step, 0, step))
        phase = at / exact - 1
        group = (above - below) / (2 * step) / exact_group - 1
        print(
            f"three fields, hidden waves at {fit[0][1] ** 0.5:.2f} c_T: phase within "
            f"{np.abs(phase).max():.1%}, "
            f"group within {np.abs(group).max():.1%}"
        )


def three_field_frequency(
    q: np.ndarray,
    fast: Sequence[float],
    stiff: Sequence[float],
    slopes: Sequence[float],
    between: float,
) -> np.ndarray:
    """Lowest angular frequency of a surface and two hidden fields, over wave numbers [n].

    omega^2 are the eigenvalues of a matrix [3, 3]: squares of the fields' own speeds and
    stiffnesses, surface first. The hidden fields are potentials of what moves along the layer
    inside. The surface's coupling to them is proportional to q, by these two slopes; the coupling
    between the two fields does not depend on q. The matrix of each fit is positive for all q.
    """
    matrix = np.zeros((len(q), 3, 3))
    matrix[:, range(3), range(3)] = np.array(stiff) + np.outer(q**2, fast)
    matrix[:, 1:, 0] = np.outer(q, slopes)
    matrix[:, 2, 1] = between
    return np.sqrt(np.linalg.eigvalsh(matrix)[:, 0])


if __name__ == "__main__":
    main()
