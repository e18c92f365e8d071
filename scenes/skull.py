"""What lies in the head of `face`: a skull, as a mesh, and the whole head as voxels, as a scanner would see it.

`python -m ripple_sim.scenes.skull` writes `meshes/skull.obj` again; `--volume FILE` writes the voxels instead, a .npy.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.files import atomic_write

from .face import FOOT, head_solid
from .shapes import (
    Array,
    Sdf,
    capsule,
    ellipsoid,
    mirrored,
    polygonise,
    rounded_cone,
    smooth_intersection,
    smooth_union,
    sphere,
    write_obj,
)

FILE = Path(__file__).parent / "meshes" / "skull.obj"

LOW, HIGH = np.array([-0.42, -0.42, 0.10]), np.array([0.45, 0.42, 0.95])  # a box round the head [m]

# What a scanner makes of air, soft tissue and bone [Hounsfield units], the thresholds between them, and its noise.
AIR, TISSUE, BONE = -1000.0, 40.0, 1000.0
SKIN_THRESHOLD, BONE_THRESHOLD = (AIR + TISSUE) / 2, (TISSUE + BONE) / 2
_NOISE = 25.0


def skull(cell: float = 0.02) -> tuple[Array, NDArray[np.int64]]:
    """Model the skull in the head of `face`, in its frame: close under the forehead, deep under cheeks and nose."""
    V, F = polygonise(_skull_solid(), (LOW, HIGH), cell)
    return V - [0.0, 0.0, FOOT], F


def _skull_solid() -> Sdf:
    cranium = ellipsoid((-0.032, 0.0, 0.60), (0.268, 0.236, 0.258))
    upper_jaw = ellipsoid((0.125, 0.0, 0.455), (0.125, 0.125, 0.075))
    chin = ellipsoid((0.075, 0.0, 0.315), (0.105, 0.10, 0.07))
    branch = capsule((0.05, 0.115, 0.31), (-0.02, 0.125, 0.47), 0.035)
    cheekbone = capsule((0.135, 0.115, 0.50), (0.02, 0.17, 0.51), 0.025)
    spine = rounded_cone((-0.05, 0.0, 0.36), (-0.05, 0.0, 0.23), 0.06, 0.07)
    nose = capsule((0.222, 0.0, 0.575), (0.245, 0.0, 0.545), 0.018)
    socket = sphere((0.205, 0.108, 0.575), 0.075)
    solid = smooth_union(0.05, cranium, upper_jaw, chin, mirrored(branch), mirrored(cheekbone), spine)
    solid = smooth_intersection(0.02, solid, lambda points: -mirrored(socket)(points))
    return smooth_union(0.015, solid, nose)


def head_volume(spacing: float = 0.01, seed: int = 0) -> tuple[NDArray[np.int16], Array]:
    """Scan the head: voxels [i, j, k] along x, y and z [Hounsfield units], and where the first one is [m].

    The scanner blurs over a voxel and is noisy.
    """
    counts = np.ceil((HIGH - LOW) / spacing).astype(int) + 1
    nodes = np.moveaxis(np.indices(tuple(counts)), 0, -1).reshape(-1, 3) * spacing + LOW
    values = np.full(len(nodes), AIR)
    for solid, step in ((head_solid(), TISSUE - AIR), (_skull_solid(), BONE - TISSUE)):
        values += step / (1 + np.exp(np.clip(4 / spacing * solid(nodes), -50, 50)))
    values += np.random.default_rng(seed).normal(0.0, _NOISE, len(values))
    return values.round().astype(np.int16).reshape(tuple(counts)), LOW - [0.0, 0.0, FOOT]


def main() -> None:
    """Write the skull's mesh, or the head's voxels."""
    parser = argparse.ArgumentParser(description="The skull in the head of the scene face.")
    parser.add_argument("--volume", type=Path, help="write the head's voxels to this .npy instead")
    parser.add_argument("--spacing", type=float, default=0.01, help="of the voxels [m]")
    chosen = parser.parse_args()
    if chosen.volume is None:
        write_obj(FILE, *skull())
        print(FILE)
        return
    values, origin = head_volume(chosen.spacing)
    with atomic_write(chosen.volume) as unfinished, unfinished.open("wb") as file:
        np.save(file, values)
    print(f"{chosen.volume}: spacing {chosen.spacing:g} m, origin {origin.tolist()} m, bone from {BONE_THRESHOLD:g} on")


if __name__ == "__main__":
    main()
