"""Cost of overlays: processor time of a frame with and without, on the same states.

    python examples/benchmarks/overlay.py [--scene duck] [--size 1280x720] [--frames 12]

The simulation is not counted, but for what the overlays ask of it (energy, contacts, the field),
given by itself.
"""

import argparse
import time
from collections.abc import Callable
from itertools import islice

import numpy as np

from ripple_sim import Simulation, VideoOptions, load_scene
from ripple_sim.overlay import Notebook
from ripple_sim.scene import parse_request
from ripple_sim.solver.gl import shared_context
from ripple_sim.video import Film

KINDS = (
    [],
    ["height"],
    ["grid"],
    ["contacts"],
    ["time"],
    ["energy"],
    ["height", "contacts", "grid", "time", "energy"],
)
RATE = 30
START = 1.0


def seconds(work: Callable[[], object]) -> float:
    start = time.process_time()  # of all threads, those of a software driver included
    work()
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Processor seconds a frame with overlays and without."
    )
    parser.add_argument("--scene", default="duck")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--frames", type=int, default=12)
    options = parser.parse_args()
    width, height = (int(n) for n in options.size.split("x"))
    scene = load_scene(options.scene)
    first = round(START * RATE)

    # one film shows everything there is to know; each kind draws of it what it needs
    total = first + options.frames
    each = [VideoOptions(size=(width, height), fps=RATE, overlay=words) for words in KINDS]
    source = Film([Simulation(scene, fps=RATE)], each[-1], total)
    films = [Film(source.simulations, video, total) for video in each]
    books = [Notebook(parse_request(words), source.simulations, total, RATE) for words in KINDS]
    drawing, noting = np.zeros((2, len(KINDS), options.frames))
    for shot in islice(source.shots(), first, None):
        for kind, (film, book) in enumerate(zip(films, books, strict=True)):
            frame = shot.number - first
            drawing[kind, frame] = seconds(
                lambda film=film, shot=shot: list(film.render_all([shot]))
            )
            noting[kind, frame] = seconds(book.follow)
    print(shared_context().renderer)
    print(f"{options.scene}, {width}x{height}; processor time, least of {options.frames} frames")
    print(f"{'overlays':36} drawing  ratio   beside the simulation")
    for words, draw, note in zip(KINDS, drawing.min(axis=1), noting.min(axis=1), strict=True):
        ratio = draw / drawing[0].min()
        print(f"{','.join(words) or 'none':36} {draw:.4f} s {ratio:5.2f}   {note:.4f} s")


if __name__ == "__main__":
    main()
