"""Compare the routes of `make_collidable`: bodies of several shapes drop on a mesh.

    python examples/benchmarks/collision_routes.py [--drops 8]

Place: distance from the point where the surface is loaded to the body that loads it, median and
largest, over the target's size of 0.9 m. Momentum: impulses on the surface over what the bodies
lose (for a stack, over their weight). Thrown: the largest speed after a hit over the speed before.
Time: median of an `mj_step` with a touching body.
"""

import argparse
import time
import warnings
from collections.abc import Iterator
from typing import NamedTuple

import igl
import mujoco
import numpy as np
import trimesh

from ripple_sim import Material, Ripples, RippleWarning, make_collidable
from ripple_sim.coupling import ROUTES
from ripple_sim.scenes.shapes import limbed, peanut

GEOM = mujoco.mjtGeom
BODIES = {
    "ball": (GEOM.mjGEOM_SPHERE, [0.05, 0, 0]),
    "box": (GEOM.mjGEOM_BOX, [0.05, 0.05, 0.05]),
    "mesh": (GEOM.mjGEOM_MESH, None),
}
DT = 0.002
MASS = 0.3
SPEED = 2.0


class Result(NamedTuple):
    place: np.ndarray  # [m], of every load
    momentum: float
    thrown: float
    seconds: float


def bench() -> tuple[np.ndarray, np.ndarray]:
    """A bench of 0.9 m: a seat on two legs, with a back."""
    x = np.array([0, 2, 2, 7, 7, 9, 9, 8, 8, 0]) / 10
    z = np.array([0, 0, 6, 6, 0, 0, 14, 14, 9, 9]) / 20
    corners = [
        (0, 1, 2),
        (0, 2, 9),
        (2, 3, 8),
        (2, 8, 9),
        (3, 4, 5),
        (3, 5, 8),
        (5, 6, 8),
        (6, 7, 8),
    ]
    solid = trimesh.creation.extrude_triangulation(np.column_stack([x, z]), np.array(corners), 0.5)
    solid = solid.subdivide_to_size(0.1)
    return solid.vertices[:, [0, 2, 1]] * [1, -1, 1], solid.faces


def target_spec(
    shape: tuple[np.ndarray, np.ndarray], route: str, free: bool = False
) -> mujoco.MjSpec:
    V, F = shape
    spec = mujoco.MjSpec()
    spec.option.timestep = DT
    spec.default.geom.condim = 1
    spec.default.geom.solref = [0.01, 0.6]
    spec.add_mesh(name="target", uservert=V.ravel(), userface=F.ravel())
    body = spec.worldbody.add_body(name="target")
    if free:
        body.add_freejoint()
    body.add_geom(name="target", type=GEOM.mjGEOM_MESH, meshname="target", mass=3.0)
    make_collidable(spec, "target", route)
    return spec


def add_body(spec: mujoco.MjSpec, kind: str, name: str, place: list[float]) -> None:
    shape, size = BODIES[kind]
    body = spec.worldbody.add_body(name=name, pos=place)
    body.add_freejoint()
    if size is None:
        V, F = peanut(0.05)
        spec.add_mesh(name=name, uservert=(0.2 * V).ravel(), userface=F.ravel())
        body.add_geom(name=name, type=shape, meshname=name, mass=MASS)
    else:
        body.add_geom(name=name, type=shape, size=size, mass=MASS)


def distance_to(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> float:
    """Distance from a point to the surface of a geom, for a mesh to its hull [m]."""
    local = (point - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    size = model.geom_size[geom]
    match model.geom_type[geom]:
        case GEOM.mjGEOM_SPHERE:
            return abs(float(np.linalg.norm(local)) - size[0])
        case GEOM.mjGEOM_PLANE:
            return abs(float(local[2]))
        case GEOM.mjGEOM_BOX:
            solid = trimesh.creation.box(extents=2 * size)
        case _:
            mesh = model.geom_dataid[geom]
            solid = trimesh.convex.convex_hull(
                model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
            )
    squared, _, _ = igl.point_mesh_squared_distance(
        local[None], np.array(solid.vertices), np.array(solid.faces)
    )
    return float(np.sqrt(squared[0]))


def played(
    model: mujoco.MjModel, data: mujoco.MjData, seconds: float
) -> Iterator[tuple[list, np.ndarray, float]]:
    """Impulses, change of the velocities by contacts, and seconds of `mj_step`, step by step."""
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=48, backend="cpu")
    while data.time < seconds:
        before = data.qvel.copy()
        start = time.thread_time()
        mujoco.mj_step(model, data)
        spent = time.thread_time() - start
        ripples.step(data)
        change = data.qvel - before
        change[2::6] -= model.opt.gravity[2] * DT
        yield ripples.last_impulses, change, spent


def drop(route: str, kind: str, drops: int) -> Result:
    spec = target_spec(limbed(0.03), route)
    add_body(spec, kind, "body", [0, 0, 3])
    model = spec.compile()
    rng = np.random.default_rng(0)
    place = []
    given = 0.0
    lost = 0.0
    thrown = 0.0
    times = []
    model.opt.gravity[:] = 0
    for _ in range(drops):
        data = mujoco.MjData(model)
        way = rng.standard_normal(3) * [1, 1, 0.5]
        way /= np.linalg.norm(way)
        aim = rng.choice(model.mesh_vert[: model.mesh_vertnum[0]]) + data.geom_xpos[0]
        data.qpos[:7] = [*(aim + 0.7 * way), *rng.standard_normal(4)]
        data.qvel[:3] = -SPEED * way
        touched = False
        for impulses, change, spent in played(model, data, 0.6):
            touched |= bool(impulses)
            given += sum(each.impulse for each in impulses)
            lost += MASS * float(np.linalg.norm(change[:3]))
            place += [
                distance_to(model, data, model.geom("body").id, each.point) for each in impulses
            ]
            times += [spent] if impulses else []
        thrown = max(thrown, touched * float(np.linalg.norm(data.qvel[:3])) / SPEED)
    if not times:  # so few bodies that all flew past
        return Result(np.array(place), np.nan, np.nan, np.nan)
    return Result(np.array(place), given / lost, thrown, float(np.median(times)))


def stack(route: str) -> Result:
    """Three boxes on one another on the seat of a bench, for the last half of two seconds."""
    spec = target_spec(bench(), route)
    for i in range(3):
        add_body(spec, "box", f"body {i}", [0.4, -0.25, 0.51 + 0.105 * i])
    model = spec.compile()
    for geom in range(model.ngeom):
        model.geom_condim[geom] = 3
    data = mujoco.MjData(model)
    place = []
    weight = []
    times = []
    fastest = 0.0
    for impulses, _, spent in played(model, data, 2.0):
        times += [spent] if impulses else []
        if data.time > 1.0:
            weight.append(sum(each.impulse for each in impulses) / DT)
            fastest = max(fastest, float(np.abs(data.qvel).max()))
            place += [
                distance_to(model, data, model.geom(each.other).id, each.point) for each in impulses
            ]
    return Result(
        np.array(place),
        float(np.mean(weight)) / (3 * MASS * 9.81),
        fastest / SPEED,
        float(np.median(times)),
    )


def plane(route: str) -> Result:
    """The target itself falls on a plane."""
    spec = target_spec(limbed(0.03), route, free=True)
    spec.worldbody.add_geom(name="floor", type=GEOM.mjGEOM_PLANE, size=[5, 5, 1], pos=[0, 0, -0.6])
    model = spec.compile()
    data = mujoco.MjData(model)
    given = 0.0
    times = []
    for impulses, _, spent in played(model, data, 0.8):
        given += sum(each.impulse for each in impulses)
        times += [spent] if impulses else []
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    velocity = float(data.subtree_linvel[1, 2])
    # it stands on several feet: the middle of their contacts is no place
    return Result(
        np.zeros(0),
        given / (3.0 * (velocity + 9.81 * data.time)),
        abs(velocity) / SPEED,
        np.median(times),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Accuracy and cost of the routes of make_collidable."
    )
    parser.add_argument("--drops", type=int, default=8)
    drops = parser.parse_args().drops
    warnings.simplefilter("ignore", RippleWarning)
    print(
        f"{'route':8}{'touched by':15}{'place':>8}{'largest':>9}{'momentum':>10}"
        f"{'thrown':>8}{'ms':>8}"
    )
    for route in ROUTES:
        for kind in (*BODIES, "stacked boxes", "plane"):
            run = {"stacked boxes": stack, "plane": plane}.get(kind)
            place, momentum, thrown, seconds = run(route) if run else drop(route, kind, drops)
            middle, largest = (
                (np.median(place) / 0.9, place.max() / 0.9) if len(place) else (np.nan, np.nan)
            )
            print(
                f"{route:8}{kind:15}{middle:8.2%}{largest:9.2%}{momentum:10.1%}"
                f"{thrown:8.2f}{1000 * seconds:8.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
