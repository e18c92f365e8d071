"""How well do ripples show under lamps, by looks, and in MuJoCo's own frames?

    python examples/benchmarks/visibility.py

A ball of half a metre with waves of 5 mm from crest to trough and 6 cm long, under the headlight
and one more lamp. The measure is the standard deviation of what the waves change in the middle of
the ball, over the brightness there, both on the screen.
"""

import concurrent.futures
import multiprocessing
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SIZE = (320, 240)
# [m]
RADIUS = 0.25
AMPLITUDE = 0.0025
LENGTH = 0.06
LOOKAT = (0.0, 0.0, 0.28)
DISTANCE = 1.6
AZIMUTH = 60.0
ELEVATION = -25.0
SUN = '<light directional="true" pos="1 -1 3" dir="-.3 .4 -1"/>'
GEOM = (
    '<geom name="ball" pos="0 0 .28" rgba=".8 .5 .3 1" {}/><geom type="plane" size="4 4 .1" '
    'rgba="{} 1"/>'
)
# of the floor
BRIGHT = ".8 .8 .8"
DARK = ".1 .1 .1"
BALL = f'type="sphere" size="{RADIUS}"'
MJCF = "<mujoco><visual>{}</visual><asset>{}</asset><worldbody>{}{}</worldbody></mujoco>"
WEAK = '<headlight diffuse=".15 .15 .15"/>'
OFF = '<headlight active="0"/>'


def heights(points: NDArray) -> NDArray:
    """Heights of the waves [m] at points [..., 3] of the ball [m]."""
    centre = RADIUS * np.array([-0.5, -0.7, 0.5]) / np.sqrt(0.99)
    return AMPLITUDE * np.cos(2 * np.pi * np.linalg.norm(points - centre, axis=-1) / LENGTH)


def contrast(flat: NDArray, rippled: NDArray) -> float:
    """Standard deviation of the change over the mean, of frames [height, width, 3] of bytes."""
    flat, rippled = (frame @ np.array([0.2126, 0.7152, 0.0722]) for frame in (flat, rippled))
    x, y = np.meshgrid(np.arange(SIZE[0]) - SIZE[0] / 2, np.arange(SIZE[1]) - SIZE[1] / 2)
    middle = np.hypot(x, y) < 0.18 * SIZE[1]
    return float((rippled - flat)[middle].std() / flat[middle].mean())


def theirs(headlight: str) -> float:
    """By `mujoco.Renderer`, which draws the waves as a mesh."""
    os.environ["MUJOCO_GL"] = "egl"
    import mujoco
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=RADIUS)
    frames = []
    for height in (0.0 * ball.vertices[:, 0], heights(ball.vertices)):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "ball.obj"
            trimesh.Trimesh(
                ball.vertices * (1 + height[:, None] / RADIUS), ball.faces, process=False
            ).export(file)
            asset = f'<mesh name="ball" file="{file}"/>'
            geom = GEOM.format('type="mesh" mesh="ball"', BRIGHT)
            model = mujoco.MjModel.from_xml_string(MJCF.format(headlight, asset, SUN, geom))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = LOOKAT
        camera.distance = DISTANCE
        camera.azimuth = AZIMUTH
        camera.elevation = ELEVATION
        with mujoco.Renderer(model, SIZE[1], SIZE[0]) as renderer:
            renderer.update_scene(data, camera)
            frames.append(renderer.render().copy())
    return contrast(*frames)


def ours(headlight: str, look: str, lighting: str = "model", floor: str = BRIGHT) -> float:
    """By our renderer."""
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco

    from ripple_sim import Camera
    from ripple_sim.render import Renderer, Surface
    from ripple_sim.render.surfaces import Charts
    from ripple_sim.solver import HeightMap, sphere_atlas
    from ripple_sim.solver.gl import shared_context

    model = mujoco.MjModel.from_xml_string(
        MJCF.format(headlight, "", SUN, GEOM.format(BALL, floor))
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    atlas = sphere_atlas(RADIUS, 128)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), look)
    height_map = HeightMap(atlas.texels)(heights(atlas.positions).astype(np.float32))
    camera = Camera(LOOKAT, DISTANCE, AZIMUTH, ELEVATION)
    with Renderer(shared_context(), model, {0: surface}, size=SIZE, lighting=lighting) as renderer:
        return contrast(
            *(renderer.render(data, maps, camera).copy() for maps in ({}, {0: height_map}))
        )


def main() -> None:
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=spawn) as process:
        for name, headlight in (
            ("headlight as by default", ""),
            ("headlight 0.15", WEAK),
            ("no headlight", OFF),
        ):
            print(
                f"{name:24}  mujoco.Renderer {process.submit(theirs, headlight).result():.3f}",
                flush=True,
            )
            for look in ("model", "rubber", "metal"):
                print(f"{name:24}  {look:15} {ours(headlight, look):.3f}", flush=True)
    print(f"{'dark floor':24}  {'model':15} {ours('', 'model', floor=DARK):.3f}", flush=True)
    for look in ("model", "rubber", "metal"):
        print(f"{'studio':24}  {look:15} {ours('', look, 'studio'):.3f}", flush=True)


if __name__ == "__main__":
    main()
