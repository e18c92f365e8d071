"""What do depth and segmentation of many geoms cost, against `mujoco.Renderer`?

    python examples/benchmarks/depth.py [--count 1000] [--frames 10] [--rounds 3] [--size 640x480]

Geoms of one shape fill a cube that fills the frame; one of them ripples. Each renderer has a
process of its own, and the two take turns. What counts is the processor time of `update_scene` and
`render`, the least of the rounds.
"""

import argparse
import multiprocessing
import os
import time
from multiprocessing.connection import Connection

import numpy as np

SIZES = {
    "sphere": ".1",
    "capsule": ".06 .1",
    "ellipsoid": ".06 .1 .14",
    "cylinder": ".08 .1",
    "box": ".1 .1 .1",
}
HALF = 5.0  # of the cube that the geoms fill [m]


def mjcf(shape: str, count: int, width: int, height: int) -> str:
    random = np.random.default_rng(0)
    geoms = []
    for position, turn in zip(
        random.uniform(-HALF, HALF, (count, 3)), random.uniform(0, 180, (count, 3)), strict=True
    ):
        place = " ".join(f"{x:.3f}" for x in position)
        angles = " ".join(f"{angle:.1f}" for angle in turn)
        geoms.append(f'<geom type="{shape}" size="{SIZES[shape]}" pos="{place}" euler="{angles}"/>')
    return f"""<mujoco><visual><global offwidth="{width}" offheight="{height}"/></visual>
        <worldbody><geom name="target" size=".3"/>{"".join(geoms)}</worldbody></mujoco>"""


def serve(pipe: Connection, ours: bool, shape: str, count: int, width: int, height: int) -> None:
    """Draw the frames that the pipe asks for; send back mean processor times [s] by kind.

    A request for 0 frames ends the loop.
    """
    os.environ["MUJOCO_GL"] = "egl"
    import mujoco

    from ripple_sim import Material, RippleRenderer, Ripples

    model = mujoco.MjModel.from_xml_string(mjcf(shape, count, width, height))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if ours:
        ripples = Ripples(model, {"target": Material()}, resolution=16, backend="cpu")
        renderer = RippleRenderer(model, ripples, height, width)
    else:
        renderer = mujoco.Renderer(model, height, width)
    while frames := pipe.recv():
        seconds = []
        for enable in (renderer.enable_depth_rendering, renderer.enable_segmentation_rendering):
            enable()
            renderer.update_scene(data)
            renderer.render()  # the first one makes what later ones take again
            start = time.process_time()
            for _ in range(frames):
                renderer.update_scene(data)
                renderer.render()
            seconds.append((time.process_time() - start) / frames)
        pipe.send(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", default="640x480")
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    spawn = multiprocessing.get_context("spawn")
    for shape in SIZES:
        pipes = []
        for ours in (False, True):
            here, there = spawn.Pipe()
            given = (there, ours, shape, arguments.count, width, height)
            spawn.Process(target=serve, args=given, daemon=True).start()
            pipes.append(here)
        times = np.full((2, 2), np.inf)
        for _ in range(arguments.rounds):
            for renderer, pipe in enumerate(pipes):
                pipe.send(arguments.frames)
                times[renderer] = np.minimum(times[renderer], pipe.recv())
        for pipe in pipes:
            pipe.send(0)
        for kind, theirs, own in zip(("depth", "segmentation"), *times, strict=True):
            milliseconds = f"{1e3 * own:.0f} ms, MuJoCo {1e3 * theirs:.0f} ms"
            print(
                f"{arguments.count} geoms, {shape}, {kind}: {milliseconds}, ratio "
                f"{own / theirs:.2f}"
            )


if __name__ == "__main__":
    main()
