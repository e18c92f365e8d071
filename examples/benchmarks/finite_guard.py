"""What the look for NaN and infinity costs of a step of one substep on the CPU, the dearest case.

python examples/benchmarks/finite_guard.py
"""

import functools
import time
from collections.abc import Callable

from ripple_sim.solver import Material, WaveSolver, sphere_atlas
from ripple_sim.solver.waves import CHECK_INTERVAL

TIMES = 3000


def least(call: Callable[[], object]) -> float:
    """Least time of a call [s], which other programs disturb least."""
    times = []
    for _ in range(TIMES):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Print a row for each resolution."""
    print(
        "| N | step of one substep [ms] | one look [ms] | share of the steps' time |\n| --- | --- "
        "| --- | --- |"
    )
    for n in (32, 64, 128, 256):
        waves = WaveSolver(sphere_atlas(resolution=n), Material(speed=1.0), backend="cpu")
        waves.add_impulse([0.0, 0.0, 1.0], 1.0, 0.3)
        dt = waves.stable_timestep
        step = least(functools.partial(waves.step, dt))
        look = least(waves._backend.finite)
        print(
            f"| {n} | {1e3 * step:.3f} | {1e3 * look:.3f} | {look / CHECK_INTERVAL / step:.2%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
