"""Modes of the unit sphere, how far waves are from them, and orders of convergence."""

import numpy as np

from ripple_sim.solver import WaveSolver, sphere_atlas


def orders(errors: list[float]) -> np.ndarray:
    """Orders of convergence between resolutions that double."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


def zonal_harmonic(z: np.ndarray) -> np.ndarray:
    """Y_40 up to a factor: eigenvalue 20 of the unit sphere's Laplacian."""
    return (35 * z**4 - 30 * z**2 + 3) / 8


def mode_error(n: int, operator: str = "fem") -> float:
    """Relative L2 error of Y_40 after one period."""
    atlas = sphere_atlas(1.0, n)
    waves = WaveSolver(atlas, backend="cpu", operator=operator)
    start = zonal_harmonic(atlas.positions[..., 2])
    waves.height = start
    waves.step(2 * np.pi / np.sqrt(20))
    return np.sqrt(
        (atlas.areas * (waves.height - start) ** 2).sum() / (atlas.areas * start**2).sum()
    )


def swing(waves: WaveSolver, wave: np.ndarray, dt: float, steps: int) -> tuple[float, float]:
    """Frequency and decay rate [1/s] of a standing wave of mean square 1/2, from its swing."""
    waves.height = wave
    found = []
    for _ in range(steps):
        waves.step(dt)
        found.append(2 * float((waves.height * wave).mean()))
    x = np.array(found)
    # a damped swing obeys x_{n+1} = a x_n - b x_{n-1}, with a = 2 exp(-r dt) cos(w dt) and b =
    # exp(-2 r dt)
    (a, b), *_ = np.linalg.lstsq(np.stack([x[1:-1], -x[:-2]], axis=1), x[2:])
    return float(np.arccos(a / (2 * np.sqrt(b))) / dt), float(-np.log(b) / (2 * dt))
