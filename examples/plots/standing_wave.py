"""A flat endless surface, and the frequency and decay of a standing wave on it, from its swing."""

import numpy as np

from ripple_sim.solver import Atlas, Material, TexelMesh, WaveSolver, glue, texel_atlas
from ripple_sim.solver.operator import decay_time, frequency

STEPS = 120
PERIODS = 1.5


def flat_torus(n: int, side: float = 1.0) -> Atlas:
    """A square of n x n texels [m] whose opposite sides are one."""
    topology = glue(np.array([[(0, 2), (0, 3), (0, 0), (0, 1)]]), n)
    place = (np.arange(-1, n + 1) + 0.5) * side / n
    x, y = np.meshgrid(place, place)
    around = np.stack([x, y, np.zeros_like(x)], axis=-1)[None]
    return texel_atlas(TexelMesh.of(topology, around[:, 1:-1, 1:-1], beyond=around))


def swung(
    atlas: Atlas, material: Material, wave: np.ndarray, rough: float, periods: float = 1.5
) -> tuple[float, float]:
    """Frequency and decay rate [1/s] of a standing wave [C, n, n], near a known frequency [1/s]."""
    waves = WaveSolver(atlas, material, backend="cpu")
    waves.height = wave
    dt = PERIODS * 2 * np.pi / rough / STEPS
    x = []
    for _ in range(STEPS):
        waves.step(dt)
        x.append(float((waves.height * wave * atlas.areas).sum()))
    # a damped swing obeys x_{n+1} = a x_n - b x_{n-1}, with a = 2 exp(-r dt) cos(w dt) and b =
    # exp(-2 r dt)
    before = np.array(x[:-2])
    now = np.array(x[1:-1])
    after = np.array(x[2:])
    (a, b), *_ = np.linalg.lstsq(np.stack([now, -before], axis=1), after)
    return float(np.arccos(a / (2 * np.sqrt(b))) / dt), float(-np.log(b) / (2 * dt))


def plane_wave(atlas: Atlas, material: Material, q: float) -> tuple[float, float]:
    """Frequency and decay rate [1/s] of a plane wave on a flat torus; wave number in 1/m."""
    rough = max(frequency(material, q), 0.1 / decay_time(material, q))
    return swung(atlas, material, np.cos(q * atlas.positions[..., 0]), rough)
