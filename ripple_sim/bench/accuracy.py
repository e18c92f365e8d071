"""How exact the operators are, where theory is exact: a mode of the sphere, and energy."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver import WaveSolver, sphere_atlas
from ripple_sim.solver.waves.operator import OPERATORS


def sphere_mode_error(resolution: int, operator: str = "fem") -> float:
    """Relative L2 error of the unit sphere's mode Y_40 after one period, at 1 m/s."""
    atlas = sphere_atlas(1.0, resolution)
    waves = WaveSolver(atlas, backend="cpu", operator=operator)
    z = atlas.positions[..., 2]
    mode = (35 * z**4 - 30 * z**2 + 3) / 8
    waves.height = mode
    waves.step(2 * np.pi / np.sqrt(20))
    return float(np.sqrt((atlas.areas * (waves.height - mode) ** 2).sum() / (atlas.areas * mode**2).sum()))


def sphere_modes(resolutions: tuple[int, ...] = (16, 32, 64, 128, 256)) -> dict[str, dict[str, float]]:
    """Errors of all operators over the resolution, and their order by regression."""
    table = {}
    for operator in OPERATORS:
        sizes = resolutions if operator == "fem" else tuple(n for n in resolutions if n <= 64)
        errors = [sphere_mode_error(n, operator) for n in sizes]
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        table[operator] = {**{str(n): e for n, e in zip(sizes, errors, strict=True)}, "order": float(order)}
    return table


def energy_drift(resolution: int = 64, steps: int = 10_000) -> dict[str, float]:
    """Largest relative change of the energy over a number of steps in float32, and its trend over all of them."""
    atlas = sphere_atlas(1.0, resolution)
    waves = WaveSolver(atlas, backend="cpu")
    waves.add_impulse([0.3, -0.5, 0.8], 1.0, 0.3)
    dt = waves.stable_timestep
    waves.step(10 * dt)
    momentum = waves.momentum()
    energies = [waves.energy()]
    for _ in range(100):
        waves.step(steps // 100 * dt)
        energies.append(waves.energy())
    change = np.array(energies) / energies[0] - 1
    trend = np.polyfit(np.linspace(0, 1, len(change)), change, 1)[0]
    return {
        "steps": steps,
        "largest": float(np.abs(change).max()),
        "trend": float(trend),
        "momentum_change": abs(waves.momentum() - momentum),
    }
