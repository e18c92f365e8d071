"""How well do the stages of a render overlap? The whole, against the sum of its stages run alone.

    python examples/benchmarks/overlap.py [SCENE] [--size 1280x720] [--frames 48] [--rounds 3]

Set-up, simulation, drawing and encoding run one after the other, each alone with what it needs
ready in memory, then the whole `render_video`; all that several times in turn, so that everything
meets the same machine. The least times count.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from ripple_sim import Simulation, VideoOptions, load_scene, render_video
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.encode import open_writer

Result = TypeVar("Result")
FPS = 60


def main() -> None:
    parser = argparse.ArgumentParser(
        description="The whole of a render against the sum of its stages."
    )
    parser.add_argument("scene", nargs="?", default="duck")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    width, height = (int(n) for n in options.size.split("x"))
    scene = load_scene(options.scene)
    rounds: dict[str, list[tuple[float, float]]] = {}

    def timed(name: str, work: Callable[[], Result]) -> Result:
        """Note the seconds on the clock, and those of all cores together."""
        clock = time.perf_counter()
        processor = time.process_time()
        result = work()
        rounds.setdefault(name, []).append(
            (time.perf_counter() - clock, time.process_time() - processor)
        )
        return result

    def set_up() -> tuple[Simulation, FrameSource]:
        simulation = Simulation(scene, fps=FPS)
        return simulation, FrameSource(simulation, width=width, height=height)

    def encode(path: Path, frames: list) -> None:
        with open_writer(path, width=width, height=height, fps=FPS) as writer:
            for frame in frames:
                writer.write(frame)

    video = VideoOptions(size=(width, height), fps=FPS, duration=options.frames / FPS, overlay=())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        simulation, frames = set_up()
        *_, state = snapshots(simulation, options.frames)
        frames.render(state)  # what is compiled once, and kept on the disk, is not counted
        for _ in range(options.rounds):
            simulation, frames = timed("set-up", set_up)
            states = snapshots(simulation, options.frames, alive=options.frames)
            states = timed("simulation", lambda states=states: list(states))
            images = timed(
                "drawing",
                lambda states=states, frames=frames: [frames.render(state) for state in states],
            )
            timed("encoding", lambda images=images: encode(path, images))
            del simulation, frames, states, images
            timed(
                "whole",
                lambda: render_video(scene, path, video),
            )

    least = {
        name: [min(times) for times in zip(*each, strict=True)] for name, each in rounds.items()
    }
    cores = os.cpu_count() or 1
    print(
        f"{options.scene}, {options.frames} frames of {width}x{height}, {cores} cores; seconds, "
        f"least of rounds"
    )
    print("              clock  all cores")
    for name, (clock, processor) in least.items():
        print(f"{name:11} {clock:8.2f} {processor:8.2f}")
    alone = sum(clock for name, (clock, _) in least.items() if name != "whole")
    work = sum(processor for name, (_, processor) in least.items() if name != "whole")
    print(
        f"stages alone, added up: {alone:.2f} s; their work spread evenly over the cores: "
        f"{work / cores:.2f} s"
    )
    print(f"whole / stages alone: {least['whole'][0] / alone:.2f}")


if __name__ == "__main__":
    main()
