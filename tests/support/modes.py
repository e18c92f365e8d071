"""Modes of the unit sphere, and how far waves are from them."""

import numpy as np

from ripple_sim.solver import WaveSolver, sphere_atlas


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
    return np.sqrt((atlas.areas * (waves.height - start) ** 2).sum() / (atlas.areas * start**2).sum())
