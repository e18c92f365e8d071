"""The OpenGL context: freed objects, devices, drivers, sources and messages."""

import gc
import os
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import numpy as np
import pytest
from programs import PROGRAMS, ended

from ripple_sim.solver import GLError, Material, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import (
    GLContext,
    create_context,
    creation,
    current_context,
    is_software,
    load_shader,
    shared_context,
)


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


def test_errors_of_moderngl_become_one_error(gl_backend: str) -> None:
    with pytest.raises(GLError, match="OpenGL failed on"), shared_context() as ctx:
        ctx.buffer(b"1234").read(size=8)


def output_of(program: str) -> str:
    """What one of the tests' programs prints, in a process of its own."""
    return ended(PROGRAMS / program, timeout=300, check=True).stdout


def test_lost_context_is_reported(opengl: None) -> None:
    assert "is lost" in output_of("lose_context.py")


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


def test_a_thread_that_never_leaves_the_context_is_named(
    gl_backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
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
def test_a_fork_is_refused_with_advice_and_auto_takes_the_cpu(opengl: None) -> None:
    lines = output_of("solve_after_fork.py").splitlines()
    assert len(lines) == 3 and lines[1] == "cpu"
    assert all(
        "is a fork; start processes with multiprocessing's method 'spawn'" in lines[i]
        for i in (0, 2)
    )


PROCESSOR = [
    "llvmpipe (LLVM 15.0.7, 256 bits)",
    "softpipe",
    "Mesa Software Rasterizer",
    "SWR (LLVM 12.0.0, 256 bits)",
    "LLVMPIPE",
]
AMD = "AMD Radeon RX 6800 (radeonsi, navi21, LLVM 15.0.7, DRM 3.49)"
INTEL = "Mesa Intel(R) UHD Graphics 620 (KBL GT2)"
GPU = [AMD, INTEL, "NVIDIA H200/PCIe/SSE2", "Apple M1", "D3D12 (NVIDIA GeForce RTX 3080)"]


@pytest.mark.parametrize("renderer", PROCESSOR + GPU)
def test_software_drivers_are_recognised_by_name(renderer: str) -> None:
    assert is_software(renderer) == (renderer in PROCESSOR)


@pytest.mark.parametrize("device", [99, 1000])
def test_a_device_that_does_not_exist_is_named_in_the_error(opengl: None, device: int) -> None:
    with pytest.raises(GLError, match=rf"EGL device {device} \(.+\); devices are counted from 0"):
        create_context(device)


def test_the_device_chosen_for_mujoco_is_used(opengl: None, monkeypatch) -> None:
    made = []
    create = moderngl.create_context
    monkeypatch.setattr(
        "moderngl.create_context", lambda **settings: made.append(settings) or create(**settings)
    )
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "0")
    create_context(None).ctx.release()
    assert [settings["device_index"] for settings in made] == [0]
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "99")
    with pytest.raises(
        GLError,
        match=r"EGL device 99, which MUJOCO_EGL_DEVICE_ID names \(.+\); devices are counted",
    ):
        GLContext()
    create_context(0).ctx.release()  # what the program asks for comes first


@pytest.mark.parametrize("value", ["", "gpu", "1.5"])
def test_a_device_for_mujoco_that_is_no_number_is_refused(
    opengl: None, monkeypatch, value: str
) -> None:
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", value)
    with pytest.raises(
        GLError, match=f"MUJOCO_EGL_DEVICE_ID must be the number of an EGL device.*got '{value}'"
    ):
        create_context(None)


def test_a_device_below_zero_is_refused_before_anything_is_read_there(
    opengl: None, monkeypatch
) -> None:
    with pytest.raises(GLError, match="there is no EGL device -1; devices are counted from 0"):
        create_context(-1)
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "-1")
    with pytest.raises(
        GLError, match="there is no EGL device -1, which MUJOCO_EGL_DEVICE_ID names"
    ):
        create_context(None)


def drawing_threads(**variables: str) -> int:
    """How many threads llvmpipe has in a process with our context; other drivers are skipped."""
    environment = {name: value for name, value in os.environ.items() if name != "LP_NUM_THREADS"}
    environment.update(variables)
    program = PROGRAMS / "count_drawing_threads.py"
    done = ended(program, env=environment, timeout=300, check=True)
    renderer, count = done.stdout.splitlines()
    if "llvmpipe" not in renderer:
        pytest.skip("needs the driver llvmpipe")
    return int(count)


def test_llvmpipe_draws_without_threads_unless_the_user_says_how_many(opengl: None) -> None:
    """A thread of llvmpipe's may unlock a fence that is freed: glibc then ends the program."""
    assert drawing_threads() == 0
    assert drawing_threads(LP_NUM_THREADS="3") == 3


NO_DEVICES = "requested device index 0, but found 0 devices"


@pytest.mark.parametrize(("reason", "devices"), [(NO_DEVICES, 8), ("libEGL.so not loaded", 1)])
def test_the_error_without_any_device_names_the_packages_to_install(
    monkeypatch, reason: str, devices: int
) -> None:
    """A library that cannot be loaded is not asked again for every device."""
    asked = []

    def fail(**settings: object) -> None:
        asked.append((settings["device_index"], settings.get("libegl")))
        raise Exception(reason)

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(GLError, match=rf"any EGL device \({reason}.*apt-get install libegl1"):
        create_context(None)
    assert {name for _, name in asked} == {None, "libEGL.so.1"}
    assert {index for index, _ in asked} == set(range(devices))
    assert len(asked) == 3 * 2 * devices  # of three versions


def test_a_driver_that_is_too_old_is_named_with_its_version_and_the_one_needed(
    opengl: None,
) -> None:
    environment = {**os.environ, "MESA_GL_VERSION_OVERRIDE": "4.0"}
    result = ended(PROGRAMS / "count_drawing_threads.py", env=environment)
    assert re.search(
        r"GLError: .+ has OpenGL 4\.0; rendering needs 4\.1 or later, backend 'gl' 4\.3",
        result.stderr,
    )


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_the_error_without_a_context_names_the_features_that_work(
    system: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr(creation, "egl_exists", lambda: False)

    def no_context(**settings: object) -> None:
        raise RuntimeError("no pixel format")

    monkeypatch.setattr("glcontext.default_backend", lambda: no_context)
    with pytest.raises(GLError, match=r"\(no pixel format\); waves alone run with backend 'cpu'"):
        create_context(None)


def test_the_entered_context_is_current_in_its_thread_alone(opengl: None) -> None:
    context = shared_context()
    with context:
        inside = current_context()
        with context:
            assert current_context() == inside
        assert current_context() == inside
        with ThreadPoolExecutor(1) as threads:
            assert threads.submit(current_context).result() is None
    assert inside


def is_freed(created: Any) -> bool:
    return type(created.mglo).__name__ == "InvalidObject"


def test_objects_discarded_during_a_frame_are_freed_at_the_next_entry(
    opengl: None,
) -> None:
    gl = shared_context()
    with gl as ctx:
        drawn, forgotten = (ctx.simple_framebuffer((2, 2)) for _ in range(2))
        forgotten.use()  # one that is freed while it is bound must not stay so
        gl.discard([forgotten])
        with gl:
            gl.free()  # somebody is drawing
        assert not is_freed(forgotten)
        drawn.use()
        drawn.clear(0.2, 0.4, 0.6, 1.0)
        assert drawn.read() == bytes([51, 102, 153] * 4)
        forgotten.use()
    gl.free()
    assert is_freed(forgotten)
    with gl as ctx:
        drawn.clear(1.0, 0.0, 0.0, 1.0)
        assert drawn.read() == bytes([255, 0, 0] * 4)


def test_freeing_in_a_thread_does_not_wait_for_another_that_draws(opengl: None) -> None:
    gl = shared_context()
    with ThreadPoolExecutor(1) as threads, gl as ctx:
        buffer = ctx.buffer(reserve=16)
        gl.discard([buffer])
        threads.submit(gl.free).result(timeout=20)
        assert not is_freed(buffer)
    with gl:
        assert is_freed(buffer)


def test_garbage_collection_is_off_during_a_frame(
    opengl: None,
) -> None:
    """MuJoCo's contexts release all that the thread has current, when they are collected."""
    collected = []

    class Cycle:
        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            collected.append(current_context())

    assert gc.isenabled()
    for _ in range(3):
        with shared_context():
            for _ in range(3000):  # more than enough for a look at the youngest
                Cycle()
            assert not collected
        assert gc.isenabled()
        gc.collect()
        assert collected and set(collected) == {None}
        collected.clear()
    gc.disable()
    try:
        with shared_context():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


_SHADER = """#version 410
layout(std140, binding = BLOCK) uniform Numbers { vec4 number; };
layout(binding = UNIT) uniform sampler2D picture;
uniform float factor = 3.0;
uniform float more;
in float value;
out float result;
void main() { result = factor * value + more + number.x + texelFetch(picture, ivec2(0), 0).r; }
"""


def test_a_program_is_used_again_with_the_uniforms_that_it_began_with(
    opengl, tmp_path, monkeypatch
):
    (tmp_path / "pooled_shaders").mkdir()
    (tmp_path / "pooled_shaders" / "__init__.py").touch()
    (tmp_path / "pooled_shaders" / "scale.glsl").write_text(_SHADER)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "pooled_shaders", raising=False)
    gl = shared_context()
    first, other = (
        gl.program("pooled_shaders", "scale", "result", BLOCK=3, UNIT=5) for _ in range(2)
    )
    assert other is not first  # two at a time have uniforms of their own
    with gl:
        first["factor"] = 5.0
        first["more"] = 1.0
    gl.release(first)
    again = gl.program("pooled_shaders", "scale", "result", BLOCK=3, UNIT=5)
    assert again is first
    with gl as ctx:
        assert (again["factor"].value, again["more"].value) == (3.0, 0.0)
        # what it captures, and reads at the unit and the binding that its source names
        given = ctx.buffer(np.arange(3, dtype="f4"))
        got = ctx.buffer(reserve=12)
        ctx.buffer(np.full(4, 50.0, "f4")).bind_to_uniform_block(3)
        ctx.texture((1, 1), 1, np.full(1, 700.0, "f4"), dtype="f4").use(5)
        ctx.simple_framebuffer((1, 1)).use()
        ctx.vertex_array(again, [(given, "f", "value")]).transform(got, moderngl.POINTS)
        ctx.detect_framebuffer(0).use()
        np.testing.assert_allclose(np.frombuffer(got.read(), "f4"), [750.0, 753.0, 756.0])


@pytest.mark.parametrize(
    ("free", "ours", "expected"), [(1e6, True, "true"), (1e9, True, None), (1e9, False, "true")]
)
def test_mesa_keeps_no_shaders_on_a_disk_that_is_nearly_full_or_not_ours(
    free, ours, expected, monkeypatch
) -> None:
    """A page of the memory-mapped cache without room on the disk is a bus error."""
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=free))
    monkeypatch.setattr("os.access", lambda *_: ours)
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE", raising=False)
    create_context(None).ctx.release()
    assert os.environ.get("MESA_SHADER_CACHE_DISABLE") == expected
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE", raising=False)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a package with shaders in two folders."""
    (tmp_path / "some_shaders" / "shared").mkdir(parents=True)
    (tmp_path / "some_shaders" / "passes").mkdir()
    (tmp_path / "some_shaders" / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "some_shaders", raising=False)
    files = {
        "passes/one.glsl": (
            '#version 430\n#include "shared/outer.glsl"\n#include '
            '"shared/inner.glsl"\nvoid main() {}\n'
        ),
        "shared/outer.glsl": '#include "shared/inner.glsl"\n// outer, HALF\n',
        "shared/inner.glsl": "// inner, N\n",
        "passes/lost.glsl": '#version 430\n#include "shared/none.glsl"\n',
        "passes/bare.glsl": "void main() {}\n",
    }
    for path, text in files.items():
        (tmp_path / "some_shaders" / path).write_text(text)
    return "some_shaders"


def test_includes_are_put_in_once_and_defines_at_the_top(package: str) -> None:
    text = load_shader(package, "passes/one", N=8, HALF=0.5, OTHER=1)
    assert text == (
        "#version 430\n#define N 8\n#define HALF 0.5\n// inner, N\n\n// outer, HALF\n\n\nvoid "
        "main() {}\n"
    )


def test_a_missing_file_is_named_and_a_shader_starts_with_its_version(package: str) -> None:
    for name, message in (
        ("lost", r"some_shaders has no shader shared/none\.glsl"),
        ("two", r"has no shader passes/two\.glsl"),
        ("bare", "must start with #version"),
    ):
        with pytest.raises(GLError, match=message):
            load_shader(package, f"passes/{name}")


def test_a_stage_has_the_common_source_and_its_own_part(package: str, tmp_path: Path) -> None:
    folder = tmp_path / "some_shaders"
    (folder / "rays.glsl").write_text("all\n#stage vertex\ncast\n#stage fragment\nmeet\n")
    text = '#version 430\n#include "rays.glsl"\n#stage fragment\nshade\n#stage vertex\nplace\n'
    (folder / "pass.glsl").write_text(text)
    lines = {stage: load_shader(package, "pass", stage).split() for stage in ("vertex", "fragment")}
    assert lines["vertex"][2:] == ["all", "cast", "place"]
    assert lines["fragment"][2:] == ["all", "meet", "shade"]
