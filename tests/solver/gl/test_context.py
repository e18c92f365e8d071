"""The OpenGL context: what it frees, and how it says that something went wrong.

Drivers that render on the processor are known by their names.

EGL: contexts by device, and which one is current.

Fences wait for what the driver says, call by call. The driver here is made of Python functions.
"""

import ctypes
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
from ripple_sim.solver.gl import context, is_software, shared_context
from ripple_sim.solver.gl.context import Fences, create_context, current_context, load_egl
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


PROCESSOR = [
    "llvmpipe (LLVM 15.0.7, 256 bits)",
    "softpipe",
    "Mesa Software Rasterizer",
    "SWR (LLVM 12.0.0, 256 bits)",
    "LLVMPIPE",
]
GPU = [
    "NVIDIA H200/PCIe/SSE2",
    "AMD Radeon RX 6800 (radeonsi, navi21, LLVM 15.0.7, DRM 3.49)",
    "Mesa Intel(R) UHD Graphics 620 (KBL GT2)",
    "Apple M1",
    "D3D12 (NVIDIA GeForce RTX 3080)",
]


@pytest.mark.parametrize("renderer", PROCESSOR)
def test_software_drivers_are_told_by_their_name(renderer: str) -> None:
    assert is_software(renderer)


@pytest.mark.parametrize("renderer", GPU)
def test_drivers_of_gpus_are_not_taken_for_software(renderer: str) -> None:
    assert not is_software(renderer)


def test_a_context_knows_what_its_own_driver_is(opengl: None) -> None:
    context = shared_context()
    assert context.software == is_software(context.renderer)


@pytest.mark.parametrize("device", [99, 1000])
def test_a_device_that_does_not_exist_is_named_in_the_error(opengl: None, device: int) -> None:
    with pytest.raises(GLError, match=rf"EGL device {device} \(.+\); devices are counted from 0"):
        create_context(device)


def test_without_any_device_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fail(**settings: object) -> None:
        asked.append((settings["device_index"], settings.get("libegl")))
        raise Exception("requested device index 0, but found 0 devices")

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(GLError, match=r"any EGL device \(requested device.*apt-get install libegl1"):
        create_context(None)
    assert {name for _, name in asked} == {None, "libEGL.so.1"}
    assert {index for index, _ in asked} == set(range(8))


def test_a_library_that_cannot_be_loaded_is_not_asked_again_for_every_device(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fail(**settings: object) -> None:
        asked.append(settings.get("libegl"))
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(GLError, match="not loaded"):
        create_context(None)
    assert asked == [None, "libEGL.so.1"]


def test_the_context_that_is_entered_is_the_current_one(opengl: None) -> None:
    context = shared_context()
    with context:
        inside = current_context()
        with context:
            assert current_context() == inside
        assert current_context() == inside
    assert inside


def test_other_threads_have_no_current_context(opengl: None) -> None:
    seen = []
    with shared_context():
        thread = threading.Thread(target=lambda: seen.append(current_context()))
        thread.start()
        thread.join()
    assert seen == [None]


def test_the_library_knows_the_functions_that_fences_need(opengl: None) -> None:
    with shared_context():
        find = load_egl().eglGetProcAddress
        assert all(find(name) for name in (b"glFenceSync", b"glClientWaitSync", b"glDeleteSync"))


ALREADY, EXPIRED, SATISFIED, FAILED = 0x911A, 0x911B, 0x911C, 0x911D


class Driver:
    """Answers waits with the given states in turn, and notes what it is asked for."""

    def __init__(self, *states: int) -> None:
        self.states, self.calls = list(states), []
        pointer, number, wide = ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64
        self._functions = {
            b"glFenceSync": ctypes.CFUNCTYPE(pointer, number, number)(self._create),
            b"glClientWaitSync": ctypes.CFUNCTYPE(number, pointer, number, wide)(self._wait),
            b"glDeleteSync": ctypes.CFUNCTYPE(None, pointer)(self._delete),
        }

    def address(self, name: bytes) -> int:
        return ctypes.cast(self._functions[name], ctypes.c_void_p).value

    def _create(self, condition: int, flags: int) -> int:
        self.calls.append(("create", condition, flags))
        return 2**40 + 5

    def _wait(self, fence: int, flags: int, patience: int) -> int:
        assert patience > 0
        self.calls.append(("wait", fence, flags))
        return self.states.pop(0)

    def _delete(self, fence: int) -> None:
        self.calls.append(("delete", fence))


FENCE = 2**40 + 5  # handles are pointers, wider than 32 bits
WAIT, DELETE = ("wait", FENCE, 1), ("delete", FENCE)


@pytest.mark.parametrize("state", [ALREADY, SATISFIED])
def test_a_fence_that_is_reached_is_deleted(state: int) -> None:
    driver = Driver(state)
    fences = Fences(driver.address)
    assert fences.reached(fences.put(), 0.1)
    assert driver.calls == [("create", 0x9117, 0), WAIT, DELETE]


def test_a_fence_that_is_not_reached_in_time_stays() -> None:
    driver = Driver(EXPIRED, SATISFIED)
    fences = Fences(driver.address)
    assert not fences.reached(FENCE, 0.1)
    assert driver.calls == [WAIT]
    assert fences.reached(FENCE, 0.1)


def test_a_failed_wait_deletes_the_fence_and_raises() -> None:
    driver = Driver(FAILED)
    with pytest.raises(GLError, match="cannot wait for its own commands; see `ripple-sim info`"):
        Fences(driver.address).reached(FENCE, 0.1)
    assert driver.calls == [WAIT, DELETE]


_SHADER = """#version 430
layout(local_size_x = 1) in;
uniform float factor = 3.0;
uniform float more;
layout(std430, binding = 0) buffer Values { float values[]; };
void main() { values[0] = factor * values[0] + more; }
"""


@pytest.mark.usefixtures("opengl")
def test_a_program_is_used_again_with_the_uniforms_that_it_began_with(tmp_path, monkeypatch):
    (tmp_path / "pooled_shaders").mkdir()
    (tmp_path / "pooled_shaders" / "__init__.py").touch()
    (tmp_path / "pooled_shaders" / "scale.glsl").write_text(_SHADER)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "pooled_shaders", raising=False)
    gl = shared_context()
    first = gl.compute_shader("pooled_shaders", "scale")
    other = gl.compute_shader("pooled_shaders", "scale")
    assert other is not first  # two at a time have uniforms of their own
    with gl:
        first["factor"], first["more"] = 5.0, 1.0
    gl.release(first)
    again = gl.compute_shader("pooled_shaders", "scale")
    assert again is first
    with gl:
        assert (again["factor"].value, again["more"].value) == (3.0, 0.0)


class Compiled:
    """A program without uniforms."""

    def __init__(self, number: int) -> None:
        self.glo = number

    def __iter__(self):
        return iter(())


def test_a_full_pool_lets_go_of_what_has_been_idle_for_longest(monkeypatch):
    """It refused what came later, so that what was used now was compiled each time."""
    monkeypatch.setattr(context, "_MOST", 2)
    pool, programs = context.ProgramPool(), [Compiled(number) for number in range(4)]
    new = Compiled(4)
    for program in programs[:3]:
        assert pool.take((f"source {program.glo}",), lambda program=program: program) is program
    assert [pool.give_back(program) for program in programs] == [None, None, programs[0], programs[3]]
    assert pool.take(("source 0",), lambda: new) is new
    for program in programs[2:0:-1]:
        assert pool.take((f"source {program.glo}",), lambda: pytest.fail("compiled again")) is program
