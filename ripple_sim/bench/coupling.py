"""What the coupling costs beside the physics: bodies rain on targets that collide as their true surface."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.scenes.shapes import duck, ellipsoid, polygonise, smooth_intersection
from ripple_sim.solver import Material

Shape = tuple[NDArray[np.float64], NDArray[np.int64]]

BODIES = 30
RESOLUTION = 128
SECONDS = 1.0  # all have hit, and those that can lie still do
ROUNDS = 3

_GEOM = mujoco.mjtGeom
_SHAPES = (
    (_GEOM.mjGEOM_SPHERE, (0.06, 0, 0)),
    (_GEOM.mjGEOM_BOX, (0.05, 0.05, 0.05)),
    (_GEOM.mjGEOM_CAPSULE, (0.04, 0.05, 0)),
    (_GEOM.mjGEOM_ELLIPSOID, (0.07, 0.055, 0.04)),
    (_GEOM.mjGEOM_CYLINDER, (0.055, 0.03, 0)),
)


def dish(cell: float = 0.03) -> Shape:
    """Model a thick dish of 1.5 m, in which bodies collect."""
    hollow = ellipsoid((0.0, 0.0, 0.65), (0.8, 0.8, 0.5))
    solid = smooth_intersection(0.05, ellipsoid((0.0, 0.0, 0.4), (0.8, 0.8, 0.4)), lambda points: -hollow(points))
    return polygonise(solid, ((-0.9, -0.9, -0.1), (0.9, 0.9, 0.9)), cell)


# bodies glance off the duck, and roll, slide and lie in the dish
TARGETS: dict[str, Callable[[], Shape]] = {"duck": duck, "dish": dish}


def coupling_cost(
    targets: Mapping[str, Callable[[], Shape]] = TARGETS,
    seconds: float = SECONDS,
    bodies: int = BODIES,
    resolution: int = RESOLUTION,
    rounds: int = ROUNDS,
) -> dict[str, dict[str, float]]:
    """Seconds a step of `mj_step`, of the coupling (all of `Ripples.step` but the waves), and of the waves, by target.

    The records of impulses, which are made when they are asked for, are counted too. The thread's own time is taken. A
    run is repeated; it is the same each time, so that the shortest time of each step is what the step costs.
    """
    table = {}
    for name, shape in targets.items():
        model = rain(shape(), bodies)
        runs = [_run(model, seconds, resolution) for _ in range(rounds)]
        physics, coupling, waves = np.min([times for times, _ in runs], axis=0).mean(axis=0)
        table[name] = {
            "touching": runs[0][1],
            "mj_step [s]": float(physics),
            "coupling [s]": float(coupling),
            "waves [s]": float(waves),
            "of mj_step": float(coupling / physics),
        }
    return table


def rain(shape: Shape, bodies: int) -> mujoco.MjModel:
    """Bodies of five shapes in a cloud over a target on a floor."""
    spec, rng, (V, F) = mujoco.MjSpec(), np.random.default_rng(0), shape
    spec.default.geom.solref = [0.01, 1.0]  # stiff enough for 5 m/s
    spec.add_mesh(name="target", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=_GEOM.mjGEOM_MESH, meshname="target")
    make_collidable(spec, "target")
    spec.worldbody.add_geom(name="floor", type=_GEOM.mjGEOM_PLANE, size=[5, 5, 0.1])
    low, high = V.min(axis=0), V.max(axis=0)
    for i in range(bodies):
        x, y = rng.uniform(0.5 * low[:2], 0.5 * high[:2])
        body = spec.worldbody.add_body(pos=[x, y, high[2] + 0.2 + 0.04 * i], quat=rng.standard_normal(4))
        body.add_freejoint()
        kind, size = _SHAPES[i % len(_SHAPES)]
        body.add_geom(name=f"body {i}", type=kind, size=size, density=400)
    return spec.compile()


def _run(model: mujoco.MjModel, seconds: float, resolution: int) -> tuple[NDArray[np.float64], float]:
    """Times of every step [s], [steps, 3]: physics, coupling, waves; and the mean number of bodies on the target."""
    data, material = mujoco.MjData(model), Material(speed=0.6, damping=1.0, density=200.0)
    ripples = Ripples(model, {"target": material}, resolution=resolution, backend="cpu")
    ripples.allow_any_height("target")
    waves = _Timed(ripples["target"].step)
    ripples["target"].step = waves  # type: ignore[method-assign]
    times, pairs = [], 0
    for _ in range(round(seconds / model.opt.timestep)):
        waves.seconds, start = 0.0, time.thread_time()
        mujoco.mj_step(model, data)
        moved = time.thread_time()
        ripples.step(data)
        pairs += len(ripples.last_impulses)
        times.append((moved - start, time.thread_time() - moved - waves.seconds, waves.seconds))
    return np.array(times), pairs / len(times)


class _Timed:
    """A function, and the time that its calls take [s]."""

    def __init__(self, function: Callable[..., None]) -> None:
        self._function, self.seconds = function, 0.0

    def __call__(self, *arguments: Any, **options: Any) -> None:
        start = time.thread_time()
        self._function(*arguments, **options)
        self.seconds += time.thread_time() - start
