"""What it costs to move a surface: the stiffness made anew, a step of the waves, a frame, over those of a fixed one.

python examples/benchmarks/moving.py
"""

import time
import warnings
from collections.abc import Callable

import mujoco
import numpy as np

from ripple_sim import Camera, Material, RippleRenderer, Ripples
from ripple_sim.solver import WaveSolver, sphere_atlas
from ripple_sim.solver.operator.moving import MovingOperator
from ripple_sim.solver.texels.riding import SurfaceRide

SPEED = Material(speed=1.0)
# Blender's Dynamic Paint on a canvas of 160,000 vertices that moves, a frame [ms]
DYNAMIC_PAINT, VERTICES = (58, 79), 160_000


def best(work: Callable[[int], object], count: int = 12) -> float:
    """Shortest of several runs [ms]."""
    taken = []
    for i in range(count):
        start = time.perf_counter()
        work(i)
        taken.append(time.perf_counter() - start)
    return 1e3 * min(taken)


def rebuilds() -> None:
    """Stiffness anew over one wave step, by backend and resolution."""
    print("N    stiffness [ns a texel]  all of move [ns a texel]  over a wave step, CPU  GL")
    for n in (64, 128, 164):
        atlas = sphere_atlas(1.0, n)
        V, T = atlas.mesh.V, atlas.areas.size
        waves = {backend: WaveSolver(atlas, SPEED, backend=backend) for backend in ("cpu", "gl")}
        operator = MovingOperator(atlas, SPEED, waves["cpu"].operator)
        around = SurfaceRide(atlas).around(V)
        stiffness = best(lambda i, operator=operator, around=around: operator.at(around))
        row = []
        for each in waves.values():
            each.move(1.01 * V)
            dt = 0.9 * each.stable_timestep

            def step(_: int, each: WaveSolver = each, dt: float = dt) -> None:
                each.step(dt)
                each.velocity[:1]

            def move(i: int, each: WaveSolver = each, V: np.ndarray = V) -> None:
                each.move(V * (1 + 0.01 * (i % 2)))

            row.append((best(move), best(step)))
        (cpu, cpu_step), (gl, gl_step) = row
        print(f"{n:<4} {1e6 * stiffness / T:22.1f}  {1e6 * cpu / T:24.1f}  {cpu / cpu_step:21.1f}  {gl / gl_step:.1f}")
        if n == 164:
            ratios = " to ".join(f"{each / ((cpu + cpu_step) * VERTICES / T):.0f}" for each in DYNAMIC_PAINT)
            print(f"Dynamic Paint's published frame at {VERTICES:,} vertices over move and step: {ratios}")


def frames() -> None:
    """A frame with a moving target over one with a fixed one: 8 physics steps, waves, and the picture."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/><geom type="plane" size="3 3 .1"/>
        <geom name="target" type="ellipsoid" size=".3 .3 .4" pos="0 0 .4" rgba=".2 .4 .6 1"/></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": Material(speed=1.0, density=1.0)}, resolution=64, backend="cpu")
    renderer = RippleRenderer(model, ripples, width=1280, height=720)
    camera = Camera(lookat=(0.0, 0.0, 0.4), distance=2.0, azimuth=120.0, elevation=-20.0)
    waves = ripples["target"]
    waves.add_impulse([0, 0, 0.4], 0.05, 0.1)

    def frame(i: int, moves: bool) -> None:
        for k in range(8):
            if moves:
                waves.move(waves.rest.mesh.V * [1, 1, 1 + 0.1 * np.sin(0.1 * (8 * i + k))])
            ripples.mj_step(data)
        renderer.render(data, camera)

    fixed = best(lambda i: frame(i, False))
    frame(0, True)
    moving = best(lambda i: frame(i, True))
    print(f"frame of 1280 x 720, N = 64: fixed {fixed:.0f} ms, moving {moving:.0f} ms, ratio {moving / fixed:.2f}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    rebuilds()
    frames()
