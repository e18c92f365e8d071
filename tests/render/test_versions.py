"""OpenGL 4.1, the last of macOS, gives the frames of later versions; GLX gives those of EGL."""

import os
import sys
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from floor_scenes import floor_frames
from programs import PROGRAMS, ended

from ripple_sim.solver.gl import GLContext

OPENGL_4_1 = {"MESA_GL_VERSION_OVERRIDE": "4.1", "MESA_GLSL_VERSION_OVERRIDE": "410"}


def run(program: str, *words: Path, **variables: str) -> CompletedProcess[str]:
    """A program of the tests that imports tests/support, with further environment variables."""
    path = os.pathsep.join(sys.path)
    return ended(PROGRAMS / program, *words, env={**os.environ, "PYTHONPATH": path, **variables})


@pytest.fixture
def mesa(gl: GLContext) -> None:
    if "Mesa" not in gl.version:
        pytest.skip("only Mesa can be asked for an older version")


def test_frames_of_an_older_opengl_are_the_same(mesa: None, tmp_path: Path) -> None:
    done = run("draw_in_old_opengl.py", tmp_path / "frames.npz", **OPENGL_4_1)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "frames.npz") as frames:
        assert not frames["computes"]
        for number, frame in enumerate(floor_frames()):
            assert np.ptp(frame) > 0
            np.testing.assert_array_equal(frames[f"arr_{number}"], frame)


def test_waves_in_compute_shaders_are_refused_and_auto_takes_the_cpu(mesa: None) -> None:
    done = run("solve_on_old_opengl.py", **OPENGL_4_1)
    assert done.stdout == "cpu\n"
    assert done.stderr.splitlines()[-1].endswith(
        "has OpenGL 4.1; backend 'gl' needs 4.3: take backend 'cpu'"
    )


def test_frames_of_glx_are_those_of_egl(opengl: None, screen: str, tmp_path: Path) -> None:
    done = run("draw_without_egl.py", tmp_path / "frames.npz", DISPLAY=screen)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "frames.npz") as frames:
        for number, frame in enumerate(floor_frames()):
            np.testing.assert_array_equal(frames[f"arr_{number}"], frame)
