"""Leaks: memory, file descriptors and OpenGL objects after 500 rounds of each object.

    python examples/benchmarks/leaks.py [--times 500] [solver-cpu solver-gl renderer everything
    viewer]

Each kind in a process of its own: a window of the viewer makes other OpenGL contexts of its process
unusable.
"""

import argparse
import ctypes
import gc
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim import Material, RippleRenderer, Ripples
from ripple_sim.solver import WaveSolver, sphere_atlas

MODEL = """<mujoco><worldbody><light pos="0 0 3"/><geom type="plane" size="2 2 1"/>
  <body pos="0 0 1"><freejoint/><geom name="ball" type="sphere" size="0.3"/></body></worldbody>
  </mujoco>"""


def solver(backend: str) -> Callable[[], None]:
    """A wave solver, an impulse, a step and a read."""
    atlas = sphere_atlas(resolution=16)

    def use() -> None:
        waves = WaveSolver(atlas, backend=backend)
        waves.add_impulse([1.0, 0.0, 0.0], 1.0, 0.3)
        waves.step(0.01)
        assert np.isfinite(waves.height).all()

    return use


def renderer() -> Callable[[], None]:
    """A renderer of frames and one frame, with the same waves."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ripples = Ripples(
        model, {"ball": Material(speed=1.0, density=10.0)}, resolution=8, backend="cpu"
    )

    def use() -> None:
        RippleRenderer(model, ripples, width=64, height=48).render(data)

    return use


def everything() -> Callable[[], None]:
    """A model, its ripples and a renderer."""

    def use() -> None:
        renderer()()

    return use


def viewer() -> Callable[[], None]:
    """A window of the viewer, off screen, opened, drawn in and closed."""
    from ripple_sim.viewer import Session, Window, open_scene

    scene = open_scene("sphere")

    def use() -> None:
        window = Window(Session(scene, resolution=8), size=(64, 48), off_screen=True, folder=Path())
        window.open()
        window.tick()
        window.close()

    return use


KINDS: dict[str, Callable[[], Callable[[], None]]] = {
    "solver-cpu": lambda: solver("cpu"),
    "solver-gl": lambda: solver("gl"),
    "renderer": renderer,
    "everything": everything,
    "viewer": viewer,
}


def resident() -> int:
    """Memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def descriptors() -> int:
    """Open files of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


def objects() -> int:
    """How many buffers, textures, framebuffers, vertex arrays and programs of OpenGL there are."""
    from ripple_sim.solver.gl import current, shared_context

    find = current.load_egl().eglGetProcAddress
    find.restype = ctypes.c_void_p
    find.argtypes = [ctypes.c_char_p]
    with shared_context() as ctx:
        texture = ctx.texture((1, 1), 4)
        program = ctx.program(vertex_shader="#version 430\nvoid main() { gl_Position = vec4(0); }")
        newest = {
            b"glIsBuffer": ctx.buffer(reserve=4),
            b"glIsTexture": texture,
            b"glIsFramebuffer": ctx.framebuffer([texture]),
            b"glIsVertexArray": ctx.vertex_array(program, []),
            b"glIsProgram": program,
        }
        count = 0
        for name, made in newest.items():
            exists = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(find(name))
            count += sum(map(exists, range(1, made.glo + 1)))
        for made in newest.values():
            made.release()
    return count


def measure(kind: str, times: int) -> None:
    """Print a row: what stays after so many, beside a tenth of them to warm up."""
    use = KINDS[kind]()

    def look() -> tuple[int, int, int]:
        gc.collect()
        return resident(), descriptors(), 0 if kind == "viewer" else objects()

    for _ in range(max(times // 10, 5)):
        use()
    look()  # which opens a context
    memory, files, count = look()
    for _ in range(times):
        use()
    memory_then, files_then, count_then = look()
    kept = (memory_then - memory) / times / 1e3
    print(
        f"| {kind} | {times} | {kept:.1f} | {files_then - files:+d} | {count_then - count:+d} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--times", type=int, default=500)
    parser.add_argument(
        "--one", action="store_true", help="in this process, without the head of the table"
    )
    options = parser.parse_args()
    if options.one:
        measure(options.kinds[0], options.times)
        return
    print(
        "| made and dropped | times | kept of each [kB] | files | objects of OpenGL |", flush=True
    )
    print("| --- | --- | --- | --- | --- |", flush=True)
    for kind in options.kinds:
        subprocess.run(
            [sys.executable, __file__, kind, "--one", "--times", str(options.times)], check=True
        )


if __name__ == "__main__":
    main()
