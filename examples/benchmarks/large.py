"""Big things to the first frame: time and memory of each stage.

    python examples/benchmarks/large.py [mesh|atlas|targets|bodies ...]

`mesh`: the duck, subdivided to 1,000,000 triangles. `atlas`: the duck at N = 1024. `targets`: 100
balls that ripple, with a body on each. `bodies`: 500 bodies on the duck. Each runs in a process of
its own, with warm kernels; memory is the most that was resident so far (ru_maxrss).
"""

import argparse
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim import Scene, Simulation, drop_scene, load_scene, make_collidable
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.scene import CameraEntry, MaterialEntry, RippleEntry
from ripple_sim.scenes.shapes import duck
from ripple_sim.solver import build_atlas, load_mesh

TRIANGLES = 1_000_000
RESOLUTION = 1024
TARGETS = 100
BODIES = 500
SIZE = (1280, 720)
STEPS = 10


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Print the time of a stage, on the clock and of all cores, and the peak memory so far."""
    clock = time.perf_counter()
    processor = time.process_time()
    yield
    clock = time.perf_counter() - clock
    processor = time.process_time() - processor
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"| {name} | {clock:.1f} s | {processor:.1f} s | {memory:.2f} GiB |", flush=True)


def subdivided(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The duck with a given number of triangles.

    All are cut into four while there is room, then some of them into three.
    """
    V, F = duck()
    while 4 * len(F) <= count:
        edges, at = np.unique(
            np.sort(F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0, return_inverse=True
        )
        (a, b, c) = F.T
        (ab, bc, ca) = len(V) + at.reshape(-1, 3).T
        V = np.concatenate([V, V[edges].mean(axis=1)])
        F = np.concatenate(
            [
                np.stack(each, axis=1)
                for each in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
            ]
        )
    more = (count - len(F)) // 2
    (a, b, c) = F[:more].T
    middle = len(V) + np.arange(more)
    V = np.concatenate([V, V[F[:more]].mean(axis=1)])
    split = [np.stack(each, axis=1) for each in ((a, b, middle), (b, c, middle), (c, a, middle))]
    return V, np.concatenate([*split, F[more:]])


def write_ply(path: Path, V: np.ndarray, F: np.ndarray) -> None:
    rows = np.zeros(len(F), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"] = 3
    rows["corners"] = F
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(V)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(F)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + V.astype("<f8").tobytes() + rows.tobytes())


def first_frame(scene: Scene, resolution: int | None = None) -> None:
    """Stages from a scene to its first frame, and physics steps with contact after it."""
    with stage("atlases and operators"):
        simulation = Simulation(scene, resolution=resolution, backend="cpu")
    with stage(f"{STEPS} steps of physics, contacts and waves"):
        for _ in range(STEPS):
            simulation.step()
    with stage("renderer and first frame, 1280x720"):
        source = FrameSource(simulation, width=SIZE[0], height=SIZE[1])
        source.submit(next(iter(snapshots(simulation, 1))))
        source.fetch()


def mesh() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.ply"
        write_ply(path, *subdivided(TRIANGLES))
        with stage(f"reading {TRIANGLES:,} triangles"):
            read = load_mesh(path)
        with stage("sphere map and atlas, N = 128"):
            build_atlas(read, 128)
        with stage("scene: signed distance, half thickness, MuJoCo's model"):
            scene = drop_scene(path, bodies=12)
    first_frame(scene)


def atlas() -> None:
    first_frame(load_scene("duck"), RESOLUTION)


def grid_scene(spec: mujoco.MjSpec, targets: list[str], width: float) -> Scene:
    material = MaterialEntry(speed=0.6, damping=1.0, density=100.0)
    return Scene(
        name="large",
        model=spec.compile(),
        targets=tuple(RippleEntry(geom=name, material=material, warn=False) for name in targets),
        camera=CameraEntry(lookat=(0.0, 0.0, 0.0), distance=1.5 * width, elevation=-40.0),
        duration=1.0,
    )


def targets() -> None:
    spec = mujoco.MjSpec()
    names = []
    for i in range(TARGETS):
        x = 0.5 * (i % 10) - 2.25
        y = 0.5 * (i // 10) - 2.25
        names.append(f"target {i}")
        spec.worldbody.add_geom(
            name=names[i], type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.2, 0, 0], pos=[x, y, 0]
        )
        body = spec.worldbody.add_body(pos=[x, y, 0.24])
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0])
    with stage(f"model with {TARGETS} targets"):
        scene = grid_scene(spec, names, 5.0)
    first_frame(scene, 64)


def bodies() -> None:
    V, F = duck()
    with stage(f"model with {BODIES} bodies"):
        spec = mujoco.MjSpec()
        rng = np.random.default_rng(0)
        spec.add_mesh(name="duck", uservert=V.ravel(), userface=F.ravel())
        spec.worldbody.add_geom(name="duck", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="duck")
        make_collidable(spec, "duck")
        for i in range(BODIES):
            x, y = rng.uniform(V.min(axis=0)[:2], V.max(axis=0)[:2])
            body = spec.worldbody.add_body(pos=[x, y, V[:, 2].max() + 0.03 + 0.002 * i])
            body.add_freejoint()
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0])
        scene = grid_scene(spec, ["duck"], 2.0)
    first_frame(scene)


CASES: dict[str, Callable[[], None]] = {
    "mesh": mesh,
    "atlas": atlas,
    "targets": targets,
    "bodies": bodies,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Time and memory of big things to the first frame."
    )
    parser.add_argument("cases", nargs="*", default=list(CASES), choices=[*CASES, []])
    # an OpenGL context does not outlive a fork
    spawn = multiprocessing.get_context("spawn")
    for name in parser.parse_args().cases:
        print(f"| {name} | clock | processor | memory |\n| --- | --- | --- | --- |", flush=True)
        process = spawn.Process(target=CASES[name])
        process.start()
        process.join()
        if process.exitcode:
            raise SystemExit(f"{name} ended with status {process.exitcode}")


if __name__ == "__main__":
    main()
