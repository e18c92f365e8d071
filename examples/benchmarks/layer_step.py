"""What a wave step costs with a thickness at every texel, over one thickness; and on water.

    python examples/benchmarks/layer_step.py [--resolution 128]

The contestants take turns, and the fastest turn of each counts.
"""

import argparse
import time

import numpy as np

from ripple_sim.solver import Material, WaveSolver, sphere_atlas

TURNS = 15
SUBSTEPS = 40


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Cost of a wave step with a thickness map, and on water."
    )
    parser.add_argument("--resolution", type=int, default=128)
    atlas = sphere_atlas(1.0, parser.parse_args().resolution)
    thickness = 0.3 + 0.05 * atlas.positions[..., 0]
    materials = {
        "membrane": Material.membrane(),
        "layer of one thickness": Material.layer(500.0, 0.5, 1000.0, 0.3),
        "layer with a thickness map": Material.layer(500.0, 0.5, 1000.0, thickness),
        "water": Material.water(),
    }
    waves = {
        name: WaveSolver(atlas, material, backend="cpu") for name, material in materials.items()
    }
    for each in waves.values():
        each.velocity = 1e-3  # steps of a surface at rest cost nothing
    fastest = dict.fromkeys(waves, np.inf)
    for _ in range(TURNS):
        for name, each in waves.items():
            substeps = 1 if name == "water" else SUBSTEPS
            start = time.perf_counter()
            each.step(0.99 * substeps * each.stable_timestep, substeps=substeps)
            fastest[name] = min(fastest[name], (time.perf_counter() - start) / substeps)
    uniform = fastest["layer of one thickness"]
    for name, seconds in fastest.items():
        print(
            f"{name:28} {1e3 * seconds:8.3f} ms a substep, {seconds / uniform:6.2f} of the uniform "
            f"layer's"
        )


if __name__ == "__main__":
    main()
