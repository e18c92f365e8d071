"""Heights and dents of waves on a sphere and a square, with a plain material and with every term.

python waves_on_two_surfaces.py FILE writes them to an .npz; `heights` returns them.
"""

import sys

import numpy as np
from hand_made import square

from ripple_sim.solver import Material, WaveSolver, sphere_atlas, texel_atlas


def heights() -> dict[str, np.ndarray]:
    """Heights and dents [m] by surface and material."""
    results = {}
    atlases = {"sphere": sphere_atlas(1.0, 4), "square": texel_atlas(square(4))}
    for name, atlas in atlases.items():
        every = Material(
            speed=1.0,
            bending=1e-3,
            viscosity=1e-3,
            yield_height=1e-3,
            density=2 + atlas.positions[..., 1],
        )
        for kind, material in {"plain": Material(speed=1.0), "every": every}.items():
            waves = WaveSolver(atlas, material, backend="cpu")
            waves.add_impulse([0.2, 0.3, 1.0], 0.1, 0.6)
            waves.add_force([0.2, -0.3, 1.0], 0.1, 0.6)
            waves.step(0.2)
            results[f"{name}, {kind}"] = waves.height
            results[f"{name}, {kind}, dent"] = waves.dent
    return results


if __name__ == "__main__":
    np.savez(sys.argv[1], **heights())
