"""Figure 5: a complex mesh, of about 21,000 triangles.

python examples/paper/figure_5.py
"""

import tempfile
import time
from pathlib import Path

from page import Part
from stills import strip

from ripple_sim import drop_scene
from ripple_sim.scenes.shapes import duck, write_obj
from ripple_sim.solver import build_atlas, load_mesh

CELL = 0.0172  # [m], gives about 21,000 triangles


def make(folder: Path) -> Part:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "fine_duck.obj"
        write_obj(path, *duck(CELL))
        mesh = load_mesh(path)
        start = time.perf_counter()
        build_atlas(mesh, 128, cache=False, layout="cube")
        seconds = time.perf_counter() - start
        scene = drop_scene(path, bodies=10, seed=3, up="z", look="jelly")
        file = strip(scene, [1.0, 2.0, 3.0], folder / "figure_5.png", (534, 400))
    return Part(
        "Figure 5: a complex mesh",
        (
            f"The duck has {len(mesh.F):,} triangles. Its sphere map and its atlas of "
            f"6 x 128 x 128 texels took {seconds:.2f} s."
        ),
        [(file, "Bodies rain on a jelly duck, after 1, 2 and 3 s.")],
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
