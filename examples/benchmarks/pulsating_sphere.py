"""Error of Rayleigh's integral on a surface that is not plane: a pulsating sphere.

    python examples/benchmarks/pulsating_sphere.py

All of a sphere of radius R swings with a velocity v. Its pressure at a distance r is rho c v (R /
r) k R / sqrt(1 + (k R)^2), with k the wave number in air. Rayleigh's integral takes each texel that
is faced for a part of a plane wall.
"""

import numpy as np

from ripple_sim.solver import Material, WaveSolver, sphere_atlas
from ripple_sim.sound import DENSITY, RATE, SPEED, Ear

RADIUS = 0.1
DISTANCES = (3, 10, 30)  # times the radius
SIZES = (0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 2.75, 4.0)  # k R
PERIODS = 30
VELOCITY = 1e-3  # [m/s]


def level(size: float, distance: float) -> float:
    """Level heard over the closed form's [dB], for k R and for r / R."""
    atlas = sphere_atlas(RADIUS, 24)
    swing = size * SPEED / RADIUS
    waves = WaveSolver(
        atlas, Material(speed=1e-3, stiffness=swing**2), backend="cpu", conserve_volume=False
    )
    waves.velocity = VELOCITY
    step = 1e-3
    late = distance * RADIUS / SPEED
    duration = PERIODS * 2 * np.pi / swing
    ear = Ear(waves, step)
    ear.stand(waves, RADIUS * distance * np.array([0.48, 0.6, 0.64]))
    for _ in range(int(np.ceil((duration + late) / step))):
        waves.step(step)
    # whole periods, after the beginning has passed
    begin = late + 0.3 * duration
    at = begin + np.arange(int(0.6 * duration * RATE)) / RATE
    heard = ear.heard(at, RATE)
    exact = DENSITY * SPEED * VELOCITY / distance * size / np.hypot(1, size)
    return float(20 * np.log10(np.sqrt(2) * heard.std() / exact))


def main() -> None:
    """Print a table."""
    print("k R     " + "".join(f"{size:>8}" for size in SIZES))
    for distance in DISTANCES:
        print(
            f"r = {distance:<2} R"
            + "".join(f"{level(size, distance):+8.1f}" for size in SIZES)
            + "  dB",
            flush=True,
        )


if __name__ == "__main__":
    main()
