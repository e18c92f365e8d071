"""Cost of a surface that moves over a fixed one: stiffness, wave step and frame.

python examples/benchmarks/moving.py
"""

import dataclasses
import time
import warnings
from collections.abc import Callable

import msgspec
import mujoco
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from ripple_sim import Camera, Material, RippleRenderer, Ripples, Simulation, load_scene
from ripple_sim.coupling import coarse_motions
from ripple_sim.solver import WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.operator import MovingOperator
from ripple_sim.solver.texels import MovedPlaces, SurfaceRide

SPEED = Material(speed=1.0)
# Blender's Dynamic Paint on a canvas of 160,000 vertices that moves, a frame [ms]
DYNAMIC_PAINT = (58, 79)
VERTICES = 160_000


def best(work: Callable[[int], object], count: int = 12) -> float:
    """Least processor time of all cores in several runs [ms]: little changed by a busy machine."""
    taken = []
    for i in range(count):
        start = time.process_time()
        work(i)
        taken.append(time.process_time() - start)
    return 1e3 * min(taken)


def rebuilds() -> None:
    """Stiffness anew over one wave step, by backend and resolution."""
    print(
        "layout   N    stiffness [ns a texel]  all of move [ns a texel]  over a wave step, CPU  GL"
    )
    for layout, n in (("cube", 64), ("cube", 128), ("cube", 164), ("patches", 64)):
        atlas = sphere_atlas(1.0, n)
        if layout == "patches":
            atlas = build_atlas(sphere_atlas(1.0, 24).mesh, n, layout=layout)
        V = atlas.mesh.V
        T = atlas.areas.size
        waves = {backend: WaveSolver(atlas, SPEED, backend=backend) for backend in ("cpu", "gl")}
        operator = MovingOperator(atlas, SPEED, waves["cpu"].operator)
        places = MovedPlaces(SurfaceRide(atlas), V)
        places.around  # noqa: B018 - worked out once
        stiffness = best(
            lambda i, operator=operator, places=places: operator.at(places).stencil.weights
        )
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
        print(f"{layout:<8} {n:<4} {1e6 * stiffness / T:22.1f}  {1e6 * cpu / T:24.1f}", end="")
        print(f"  {cpu / cpu_step:21.1f}  {gl / gl_step:.1f}")
        if n == 164:
            ratios = " to ".join(
                f"{each / ((cpu + cpu_step) * VERTICES / T):.0f}" for each in DYNAMIC_PAINT
            )
            print(
                f"Dynamic Paint's published frame at {VERTICES:,} vertices over move and step: "
                f"{ratios}"
            )


def exactness() -> None:
    """Mode Y_20 on a sphere that breathes, against its differential equation."""
    for n in (16, 32, 64):
        atlas = sphere_atlas(1.0, n)
        mode = (3 * atlas.positions[..., 2] ** 2 - 1) / 2
        waves = WaveSolver(atlas, SPEED, backend="cpu")
        waves.height = mode
        steps = 12 * n
        end = 3.0

        def radius(t: float) -> float:
            return 1 + 0.3 * np.sin(2 * t)

        times = np.linspace(0, end, steps + 1)[1:]
        exact = solve_ivp(
            lambda t, y: [y[1], -6 / radius(t) ** 2 * y[0]],
            (0, end),
            [1, 0],
            t_eval=times,
            rtol=1e-10,
            atol=1e-12,
        )
        errors = []
        for i, height in enumerate(exact.y[0]):
            waves.move(atlas.mesh.V * radius((i + 0.5) * end / steps))
            waves.step(end / steps)
            errors.append(np.linalg.norm(waves.height - height * mode))
        error = max(errors) / np.linalg.norm(mode)
        print(
            f"breathing sphere, N = {n}: largest error of Y_20 in 3 s over its amplitude "
            f"{error:.1e}"
        )


def wild(steps: int = 10_000) -> None:
    """A surface that stretches, twists and tumbles: what becomes of mass and momentum."""
    atlas = sphere_atlas(1.0, 8)
    waves = WaveSolver(
        atlas, Material(speed=1.0, density=3.0), backend="cpu", conserve_volume=False
    )
    mass = waves.operator.mass.copy()
    V = atlas.mesh.V
    waves.add_impulse([0, 0, 1], 1.0, 0.3)
    for i in range(steps):
        stretched = V * (1 + 0.4 * np.sin(0.07 * i * np.array([1.0, 1.3, 0.7])))
        twisted = Rotation.from_rotvec(np.outer(0.8 * np.sin(0.05 * i) * V[:, 2], [0, 0, 1])).apply(
            stretched
        )
        waves.move(Rotation.from_rotvec([0.01 * i, 0.02 * i, 0]).apply(twisted + 0.1 * i))
        waves.step(0.05)
    drift = abs(waves.momentum() + 1)
    print(
        f"{steps:,} steps of a wild motion: mass exact "
        f"{bool((waves.operator.mass == mass).all())}, "
        f"change of the momentum {drift:.0e} of what was given, finite "
        f"{bool(np.isfinite(waves.height).all())}"
    )


def counted_twice() -> None:
    """A ball drops on a jelly cube: the coarse motion in the waves, beside that of the flex."""
    for high_pass in (False, True):
        scene = load_scene("jelly")
        targets = tuple(
            msgspec.structs.replace(each, high_pass=high_pass) for each in scene.targets
        )
        simulation = Simulation(
            dataclasses.replace(scene, targets=targets), fps=50, resolution=24, backend="cpu"
        )
        waves = simulation.ripples["jelly"]
        surface = next(iter(simulation.ripples._soft.values()))
        basis = coarse_motions(waves, surface)
        root = np.sqrt(waves.operator.mass.reshape(-1))
        coarse = fine = squash = 0.0
        for _ in range(40):
            simulation.advance_frame()
            height = root * waves.height.reshape(-1) / np.linalg.norm(root)
            part = root[:, None] * basis
            followed = part @ np.linalg.lstsq(part, height, rcond=None)[0]
            coarse = max(coarse, np.linalg.norm(followed))
            fine = max(fine, np.linalg.norm(height - followed))
            squash = max(squash, np.ptp(waves.rest.mesh.V[:, 2]) - np.ptp(waves.vertices[:, 2]))
        print(
            f"jelly, high_pass {high_pass}: the flex squashes by {1e3 * squash:.1f} mm; root mean "
            f"square of the waves: "
            f"{1e3 * coarse:.2f} mm as the flex moves, {1e3 * fine:.2f} mm finer"
        )


def frames() -> None:
    """A frame with a moving target over one with a fixed target: 8 steps, waves, the picture."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
        <geom type="plane" size="3 3 .1"/>
        <geom name="target" type="ellipsoid" size=".3 .3 .4" pos="0 0 .4" rgba=".2 .4 .6 1"/>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(
        model, {"target": Material(speed=1.0, density=1.0)}, resolution=64, backend="cpu"
    )
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
    print(
        f"frame of 1280 x 720, N = 64: fixed {fixed:.0f} ms, moving {moving:.0f} ms, ratio "
        f"{moving / fixed:.2f}"
    )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    rebuilds()
    frames()
    exactness()
    wild()
    counted_twice()
