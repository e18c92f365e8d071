"""Waves on any closed mesh, without MuJoCo, and the displaced mesh written for other programs.

    python examples/any_mesh.py [MESH]

Makes out/any_mesh.ply with the height as an attribute, and out/any_mesh.png, the atlas. OBJ, PLY,
STL, OFF and GLB will do.
"""

import sys
from pathlib import Path

import numpy as np
import trimesh

from ripple_sim import plot_atlas
from ripple_sim.scenes.shapes import LIMBED_FILE
from ripple_sim.solver import Material, WaveSolver, build_atlas, load_mesh


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else LIMBED_FILE
    mesh = load_mesh(path)
    atlas = build_atlas(mesh, resolution=96)
    size = float(np.ptp(mesh.V, axis=0).max())
    # crosses the object in a second
    waves = WaveSolver(atlas, Material(speed=size, damping=0.5, stiffness=400.0))
    top = mesh.V[np.argmax(mesh.V[:, 2])]
    waves.add_height(
        0.03 * size * np.exp(-((atlas.positions - top) ** 2).sum(axis=-1) / (0.06 * size) ** 2)
    )
    waves.step(0.25)

    height = atlas.sampling_matrix(atlas.mesh.V) @ waves.height.ravel()  # texels to vertices
    Path("out").mkdir(exist_ok=True)
    displaced = trimesh.Trimesh(
        mesh.V + height[:, None] * mesh.vertex_normals, mesh.F, process=False
    )
    displaced.vertex_attributes["height"] = height.astype(np.float32)
    displaced.export("out/any_mesh.ply")
    plot_atlas(atlas, "out/any_mesh.png", title=path.stem, up="z")
    quality = atlas.quality()
    print(
        f"{len(mesh.F)} triangles, {quality['flipped']} folded, stretch at 99.9 % of the area "
        f"{quality['q999']:.2f}"
    )
    print(
        f"heights {1000 * height.min() / size:.1f} to {1000 * height.max() / size:.1f} thousandths "
        f"of its size"
    )
    print("out/any_mesh.ply, out/any_mesh.png")


if __name__ == "__main__":
    main()
