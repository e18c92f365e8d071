"""The OpenGL context: what it frees, and how it says that something went wrong."""

import os
import resource
import subprocess
import sys
import textwrap
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import GLError, Material, WaveSolver, sphere_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.operator.assembly import build_operator


def resident_bytes() -> int:
    """Memory of this process, which holds the buffers of a software driver."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_two_hundred_solvers_leave_nothing_on_the_gpu(gl_backend: str) -> None:
    material = Material(speed=1.0, viscosity=1e-3, bending=1e-4)
    operator = build_operator(sphere_atlas(1.0, 64), material, "fem")
    one = 3 * operator.stencil.weights.nbytes // 2  # its three stencils alone

    def use_some(count: int) -> None:
        for _ in range(count):
            backend = make_backend(gl_backend, operator)
            backend.kick(np.arange(5), np.ones(5, np.float32), 0.0)
            backend.advance(2, 1e-6)
            assert np.isfinite(backend.height()).all()

    use_some(20)
    before = resident_bytes()
    use_some(200)
    assert resident_bytes() - before < 20 * one


def test_a_shared_shader_is_compiled_once(gl_backend: str) -> None:
    gl = shared_context()
    package = "ripple_sim.solver.backends.shaders"
    shaders = [gl.shared_compute_shader(package, name, LIST_GROUP=64) for name in ("halo", "halo", "kick")]
    assert shaders[0] is shaders[1] and shaders[0] is not shaders[2]
    assert gl.compute_shader(package, "halo", LIST_GROUP=64) is not shaders[0]


def test_solvers_that_share_shaders_keep_their_own_coefficients(gl_backend: str) -> None:
    atlas = sphere_atlas(1.0, 8)
    materials = [Material(speed=1.0, damping=zeta) for zeta in (0.0, 3.0)]
    height = np.random.default_rng(0).standard_normal((6, 8, 8)).astype(np.float32)

    def run(backend: str) -> list[np.ndarray]:
        solvers = [WaveSolver(atlas, material, backend=backend) for material in materials]
        for waves in solvers:
            waves.height = height
        for _ in range(3):
            for waves in solvers:
                waves.step(0.05)
        return [waves.height for waves in solvers]

    for gl, cpu in zip(run(gl_backend), run("cpu"), strict=True):
        np.testing.assert_allclose(gl, cpu, atol=1e-5)


def test_running_out_of_memory_is_one_clear_error(gl_backend: str) -> None:
    with pytest.raises(GLError, match=r"out of memory.*lower resolution"), shared_context() as ctx:
        ctx.buffer(reserve=2**46)
    with shared_context():
        pass  # the error does not linger


def test_what_moderngl_raises_becomes_one_error(gl_backend: str) -> None:
    with pytest.raises(GLError, match="OpenGL failed on"), shared_context() as ctx:
        ctx.buffer(b"1234").read(size=8)


def test_waiting_for_a_fence_is_waiting_for_what_stands_before_it(gl_backend: str) -> None:
    gl = shared_context()
    with gl as ctx:
        buffers = [ctx.buffer(np.full(1 << 16, value, np.uint32)) for value in (1, 2)]
        copy = ctx.buffer(reserve=4 << 16)
        fences = []
        for buffer in buffers:
            ctx.copy_buffer(copy, buffer)
            fences.append(gl.put_fence())
        for fence in fences[::-1]:
            gl.wait_for(fence)
        assert set(np.frombuffer(copy.read(), np.uint32)) == {2}


def test_a_fence_that_is_gone_is_an_error_and_no_endless_wait(gl_backend: str) -> None:
    gl = shared_context()
    fence = gl.put_fence()
    gl.wait_for(fence)
    with pytest.raises(GLError, match="cannot wait"):
        gl.wait_for(fence)


def test_lost_context_is_reported() -> None:
    script = """
        import ctypes, sys
        from ripple_sim.solver import GLError, WaveSolver, sphere_atlas
        from ripple_sim.solver.gl import context, shared_context
        try:
            waves = WaveSolver(sphere_atlas(1.0, 8), backend="gl")
        except GLError:
            sys.exit(77)
        library = context.load_egl()
        for function in (library.eglGetCurrentDisplay, library.eglGetPlatformDisplay):
            function.restype = ctypes.c_void_p
        with shared_context():
            display = library.eglGetCurrentDisplay()
        none = ctypes.c_void_p(None)
        library.eglMakeCurrent(ctypes.c_void_p(display), none, none, none)
        library.eglTerminate(ctypes.c_void_p(display))
        try:
            waves.height
        except GLError as error:
            print(error)
    """
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=300
    )
    if result.returncode == 77:
        pytest.skip("no OpenGL")
    assert result.returncode == 0, result.stderr
    assert "is lost" in result.stdout


def test_solvers_in_several_threads_take_turns(gl_backend: str) -> None:
    def run(speed: float) -> np.ndarray:
        waves = WaveSolver(sphere_atlas(1.0, 8), Material(speed=speed), backend=gl_backend)
        waves.add_impulse([0, 0, 1], 1.0, 0.5)
        for _ in range(20):
            waves.step(0.02)
        return waves.height

    speeds = [0.5, 1.0, 1.5]
    alone = [run(speed) for speed in speeds]
    with ThreadPoolExecutor(3) as threads:
        together = list(threads.map(run, speeds))
    for a, b in zip(alone, together, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_thread_that_never_leaves_the_context_is_named(gl_backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ripple_sim.solver.gl.context._PATIENCE", 0.05)
    errors = []

    def enter() -> None:
        try:
            with shared_context():
                pass
        except GLError as error:
            errors.append(str(error))

    with shared_context():
        other = threading.Thread(target=enter, name="painter")
        other.start()
        other.join()
    assert len(errors) == 1
    assert threading.current_thread().name in errors[0] and "'painter' cannot enter it" in errors[0]
    enter()
    assert len(errors) == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_fork_is_told_to_be_spawned_and_auto_takes_the_cpu() -> None:
    script = """
        import os, sys
        from ripple_sim.solver import GLError, WaveSolver, sphere_atlas
        try:
            waves = WaveSolver(sphere_atlas(1.0, 8), backend="gl")
        except GLError:
            sys.exit(77)
        if os.fork():
            os.wait()
            sys.exit(0)
        for backend in ("gl", "auto"):
            try:
                print(WaveSolver(sphere_atlas(1.0, 8), backend=backend).backend, flush=True)
            except GLError as error:
                print(error, flush=True)
        try:
            waves.height
        except GLError as error:
            print(error, flush=True)
    """
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=300
    )
    if result.returncode == 77:
        pytest.skip("no OpenGL")
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert len(lines) == 3 and lines[1] == "cpu"
    assert all("is a fork; start processes with multiprocessing's method 'spawn'" in lines[i] for i in (0, 2))
