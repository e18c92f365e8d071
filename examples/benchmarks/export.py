"""How fast the frames of an export are written, and how much memory that takes.

    python examples/benchmarks/export.py [FRAMES]

Writes a sphere of 124,416 points with waves all over it to a USD file. The first frames, which load
kernels, do not count: 25, or half of them where there are fewer than 50. Linux tells the memory of
a process.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from ripple_sim import Exporter, Simulation, load_scene

RESOLUTION = 144
TRIANGLES = 200_000
WARM_UP = 25


def memory() -> float:
    """Of this process [MB]."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1000


def main(frames: int = 75) -> None:
    if frames < 2:
        sys.exit(f"FRAMES must be a whole number, 2 or greater, got {frames}")
    warm_up = min(WARM_UP, frames // 2)
    simulation = Simulation(load_scene("sphere"), resolution=RESOLUTION, backend="cpu")
    [name] = simulation.ripples
    waves = simulation.ripples[name]
    x, y, _ = np.moveaxis(waves.atlas.normals, -1, 0)
    waves.height = 0.02 * np.sin(9 * x) * np.cos(7 * y)
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "run.usdc"
        with Exporter(
            simulation.model, simulation.ripples, output, triangles=TRIANGLES
        ) as exporter:
            for frame in range(frames):
                waves.step(1 / 60)
                start = time.perf_counter()
                exporter.write(simulation.data)
                seconds.append(time.perf_counter() - start)
                if frame == warm_up - 1:
                    before = memory()
        rate = (frames - warm_up) / sum(seconds[warm_up:])
        print(
            f"{rate:.1f} frames a second, {before:.0f} MB after {warm_up} frames, {memory():.0f} "
            f"MB after {frames}"
        )
        print(f"{output.stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
