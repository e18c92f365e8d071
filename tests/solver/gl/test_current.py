"""The program's own OpenGL context is current again wherever ours was made, entered or left."""

import ctypes
import os
from concurrent.futures import ThreadPoolExecutor
from ctypes.util import find_library

import pytest
from own_context import own_context
from programs import PROGRAMS, ended

from ripple_sim.solver import GLError, Material, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import GLContext, create_context, current_context, shared_context
from ripple_sim.solver.gl.current import EGLCurrent, load_egl


def test_a_program_keeps_its_context_and_surfaces_where_ours_is_made_and_entered(
    opengl: None,
) -> None:
    with own_context() as own:
        assert own.draw != own.read
        ours = GLContext()
        assert EGLCurrent.of_thread() == own
        with ours, ours:
            assert current_context() not in (None, own.context)
        assert EGLCurrent.of_thread() == own
        create_context(None).ctx.release()
        assert EGLCurrent.of_thread() == own
        with pytest.raises(GLError):
            create_context(99)
        assert EGLCurrent.of_thread() == own
        waves = WaveSolver(
            sphere_atlas(1.0, 4), Material(), backend="gl" if ours.computes else "cpu"
        )
        waves.add_impulse([0.0, 0.0, 1.0], 1.0, 0.8)
        waves.step(0.1)
        assert waves.height.any()
        assert EGLCurrent.of_thread() == own
        with ThreadPoolExecutor(1) as threads:  # another thread has none, before and after
            assert threads.submit(
                lambda: (ours.__enter__(), ours.__exit__(None, None, None))
            ).result()
            assert threads.submit(current_context).result() is None
        assert EGLCurrent.of_thread() == own
    assert current_context() is None


def test_an_error_in_our_block_leaves_the_program_its_context(gl_backend: str) -> None:
    with own_context() as own:
        with pytest.raises(ZeroDivisionError), shared_context():
            _ = 1 / 0
        assert EGLCurrent.of_thread() == own
        with pytest.raises(GLError, match="out of memory"), shared_context() as ctx:
            ctx.buffer(reserve=2**46)
        assert EGLCurrent.of_thread() == own


def test_our_context_leaves_the_threads_egl_api_unchanged(opengl: None) -> None:
    egl = load_egl()
    embedded = 0x30A0
    before = egl.eglQueryAPI()
    egl.eglBindAPI(embedded)
    try:
        create_context(None).ctx.release()
        assert egl.eglQueryAPI() == embedded
    finally:
        egl.eglBindAPI(before)


def test_no_context_is_current_if_the_program_destroyed_its_own(
    opengl: None,
) -> None:
    with own_context() as own:
        with shared_context():
            assert load_egl().eglDestroyContext(
                ctypes.c_void_p(own.display), ctypes.c_void_p(own.context)
            )
        assert current_context() is None


def test_our_context_is_left_even_where_an_interrupted_entry_left_it_current(opengl: None) -> None:
    gl = shared_context()
    gl._current.make_current()
    with gl:
        pass
    assert current_context() is None


def test_a_renderer_that_takes_the_context_away_during_a_frame_is_reported(opengl: None) -> None:
    """MuJoCo's renderers release the thread's context whenever they are collected."""
    with (
        pytest.raises(GLError, match=r"was left while it drew.*Close other renderers"),
        shared_context(),
    ):
        load_egl().eglReleaseThread()
    with shared_context() as ctx:
        assert ctx.error == "GL_NO_ERROR"


def colors(own: str, **environment: str) -> list[str]:
    """Red of the pictures of a program with a context of its own, before, beside and after ours."""
    program = PROGRAMS / "draw_beside_ours.py"
    done = ended(program, own, env={**os.environ, **environment}, timeout=120)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "Core" in lines[2] and "Core" not in lines[0]
    return [line.split()[0] for line in lines]


@pytest.mark.skipif(
    not find_library("OSMesa"),
    reason="needs OSMesa (on Debian and Ubuntu: apt-get install libosmesa6)",
)
def test_a_program_that_draws_into_memory_keeps_its_context(opengl: None) -> None:
    assert colors("memory", PYOPENGL_PLATFORM="osmesa") == ["0.2", "0.4", "0.8", "0.6"]


def test_a_program_with_a_window_keeps_its_context(opengl: None, screen: str) -> None:
    assert colors("window", PYOPENGL_PLATFORM="glx", DISPLAY=screen) == ["0.2", "0.4", "0.8", "0.6"]
