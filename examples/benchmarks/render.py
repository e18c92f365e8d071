"""How long does a frame take, against MuJoCo's own renderer on the same model without ripples?

    python examples/benchmarks/render.py [--size 1280x720] [--frames 10] [--resolution 128] [--look
    rubber]

The model is one target of about 6,000 triangles, twelve balls, a floor and a lamp with a shadow;
both renderers smooth edges with 4 samples. Theirs runs in a process of its own, and the two take
turns, so that both meet the same machine.
"""

import argparse
import multiprocessing
import os
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

MESH = Path(__file__).parents[2] / "scenes" / "meshes" / "limbed.obj"
LOOKAT = (0.0, 0.0, 0.35)
DISTANCE = 2.0
AZIMUTH = 130.0
ELEVATION = -22.0


def mjcf(width: int, height: int) -> str:
    turn = 2 * np.pi * np.arange(12) / 12
    balls = "".join(
        f'<geom type="sphere" size=".06" pos="{0.75 * np.cos(a):.4f} {0.75 * np.sin(a):.4f} '
        f'{0.06 + 0.03 * i:.3f}" '
        f'rgba="{0.3 + 0.05 * i:.2f} .5 .{9 - i // 2} 1"/>'
        for i, a in enumerate(turn)
    )
    return f"""<mujoco>
      <visual><global offwidth="{width}" offheight="{height}"/><quality offsamples="4"/></visual>
      <asset><mesh name="target" file="{MESH}"/></asset>
      <worldbody>
        <light directional="true" pos="1 -1 3" dir="-.3 .4 -1" castshadow="true"/>
        <geom type="plane" size="4 4 .1" rgba=".8 .8 .8 1"/>
        <geom name="target" type="mesh" mesh="target" rgba=".8 .5 .3 1"/>
        {balls}
      </worldbody>
    </mujoco>"""


def serve_mujoco(pipe: Connection, width: int, height: int) -> None:
    """Draw a frame and send back its seconds whenever the pipe says so."""
    os.environ["MUJOCO_GL"] = "egl"
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(width, height))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = LOOKAT
    camera.distance = DISTANCE
    camera.azimuth = AZIMUTH
    camera.elevation = ELEVATION
    with mujoco.Renderer(model, height, width) as renderer:

        def draw() -> None:
            renderer.update_scene(data, camera)
            renderer.render()

        draw()
        while pipe.recv():
            pipe.send(cost(draw))


def rippled(
    width: int, height: int, resolution: int, look: str
) -> tuple[Callable[[int], None], int]:
    """A function that draws frame i of a running wave, and the number of the target's triangles."""
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco

    from ripple_sim import Camera
    from ripple_sim.render import Renderer, Surface
    from ripple_sim.render.surfaces import Charts
    from ripple_sim.solver import HeightMap, Mesh, build_atlas
    from ripple_sim.solver.gl import shared_context

    model = mujoco.MjModel.from_xml_string(mjcf(width, height))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    target = model.geom("target").id
    atlas = build_atlas(
        Mesh.from_arrays(model.mesh_vert, model.mesh_face, name="target"), resolution
    )
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), look)
    gl = shared_context()
    print(gl.renderer)
    renderer = Renderer(gl, model, {target: surface}, size=(width, height), samples=4)
    camera = Camera(LOOKAT, DISTANCE, AZIMUTH, ELEVATION)
    height_maps = [
        HeightMap(atlas.texels)(
            (0.008 * np.sin(40.0 * atlas.positions[..., 2] + phase)).astype(np.float32)
        )
        for phase in range(4)
    ]
    return lambda i: renderer.render(
        data, {target: height_maps[i % len(height_maps)]}, camera
    ), len(atlas.mesh.F)


def cost(work: Callable[[], object]) -> tuple[float, float]:
    """Time on the clock and of all cores together [s]; a busy machine changes the latter less."""
    clock = time.perf_counter()
    processor = time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processor


def main() -> None:
    parser = argparse.ArgumentParser(description="Seconds a frame, against mujoco.Renderer.")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--look", default="rubber")
    options = parser.parse_args()
    width, height = (int(n) for n in options.size.split("x"))

    pipe, end = multiprocessing.get_context("spawn").Pipe()
    server = multiprocessing.get_context("spawn").Process(
        target=serve_mujoco, args=(end, width, height)
    )
    server.start()
    draw, triangles = rippled(width, height, options.resolution, options.look)
    for frame in range(2):
        draw(frame)
    own = []
    theirs = []
    for frame in range(options.frames):
        pipe.send(True)
        theirs.append(pipe.recv())
        own.append(cost(lambda frame=frame: draw(frame)))
    pipe.send(False)
    server.join()
    print(f"{triangles} triangles, N = {options.resolution}, {width}x{height}, 4 samples")
    least, median = (
        np.array([f(times, axis=0) for times in (own, theirs)]) for f in (np.min, np.median)
    )
    print("seconds a frame          clock          processor")
    print("                     least  median   least  median")
    for row, name in enumerate(("ripple-sim", "mujoco.Renderer")):
        print(
            f"{name:18} {least[row, 0]:7.4f} {median[row, 0]:7.4f} {least[row, 1]:7.4f} "
            f"{median[row, 1]:7.4f}"
        )
    ratios = np.stack([least[0] / least[1], median[0] / median[1]], axis=1).ravel()
    print("ratio             " + "".join(f"{ratio:8.2f}" for ratio in ratios))


if __name__ == "__main__":
    main()
