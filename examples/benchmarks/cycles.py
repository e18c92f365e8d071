"""A frame of three scenes by our renderer and by Cycles, side by side, with their time and FLIP.

    python examples/benchmarks/cycles.py [--samples 16]

Makes out/cycles.webp. Needs the extra cycles (or RIPPLE_SIM_BPY_PYTHON) and the package
flip-evaluator.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim import Exporter, ExportOptions, Simulation, load_scene
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.cycles import blender_settings, frames_of_cycles, python_with_bpy
from ripple_sim.export import scene_source
from ripple_sim.render import tone_mapped

WIDTH = 480
HEIGHT = 270
FPS = 20
SCENES = (("sphere", 0.9), ("face", 0.8), ("duck", 1.65))  # and the moment [s]


def main() -> None:
    import flip_evaluator

    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, default=16)
    samples = parser.parse_args().samples
    rows = []
    for name, moment in SCENES:
        simulation = Simulation(load_scene(name), fps=FPS, resolution=96)
        ours, our_time = by_us(simulation, moment)
        theirs, their_time = by_cycles(name, simulation, samples)
        _, difference, _ = flip_evaluator.evaluate(
            theirs / np.float32(255), ours / np.float32(255), "LDR"
        )
        print(f"{name}: FLIP {difference:.3f}, ours {our_time:.2f} s, Cycles {their_time:.1f} s")
        rows.append(np.concatenate([ours, theirs], axis=1))
    path = Path("out/cycles.webp")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(rows)).save(path, quality=85, method=6)
    print(path)


def by_us(simulation: Simulation, moment: float) -> tuple[NDArray[np.uint8], float]:
    source = FrameSource(simulation, width=WIDTH, height=HEIGHT, supersample=2)
    *_, snapshot = snapshots(simulation, round(moment * FPS) + 1)
    source.render(snapshot)  # the first takes longer
    start = time.perf_counter()
    frame = source.render(snapshot)
    assert frame is not None
    return frame, time.perf_counter() - start


def by_cycles(name: str, simulation: Simulation, samples: int) -> tuple[NDArray[np.uint8], float]:
    source = scene_source(
        load_scene(name), simulation, ExportOptions(fps=FPS, size=(WIDTH, HEIGHT))
    )
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder) / "stage.usdc"
        with Exporter.of(source, stage) as exporter:
            exporter.write(simulation.data)
        settings = blender_settings(source, simulation.data)
        told = {**settings, "stage": str(stage), "frames": 1, "samples": samples}
        start = time.perf_counter()
        (frame,) = frames_of_cycles(python_with_bpy(), told, Path(folder))
        return np.rint(255 * tone_mapped(frame)).astype(np.uint8), time.perf_counter() - start


if __name__ == "__main__":
    main()
