"""OpenGL 4.1, the last of macOS, gives the frames of later versions."""

import importlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import glcontext
import moderngl
import numpy as np
import pytest
from mujoco_models import posed
from numpy.typing import NDArray
from programs import ended

from ripple_sim import Camera
from ripple_sim.render import Renderer, Surface
from ripple_sim.render.surfaces import Charts
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.gl import GLContext, shared_context

MODEL = """<mujoco>
  <asset>
    <texture name="sky" type="{sky}" builtin="gradient" rgb1=".3 .5 .7" rgb2="0 0 0" width="16"
      height="96"/>
    <texture name="dice" type="cube" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="32"
      height="192"/>
    <material name="dice" texture="dice"/>
    <material name="floor" reflectance="{reflectance}"/>
  </asset>
  <worldbody>
    <light pos="1 1 3" dir="-1 -1 -3"/>
    <geom type="plane" size="3 3 .1" material="floor"/>
    <geom type="sphere" size=".5" pos="0 0 .5"/>
    <geom type="sphere" size=".2" pos=".5 .4 .2" material="dice"/>
  </worldbody>
</mujoco>"""


def drawn() -> Iterator[NDArray]:
    """Frames and surface images of a rippling ball on three kinds of floor."""
    atlas = sphere_atlas(0.5, 24)
    heights = 0.02 * np.sin(20 * atlas.positions[..., 0] + 9 * atlas.positions[..., 2])
    height_map = HeightMap(atlas.texels)(heights.astype(np.float32))
    camera = Camera((0.0, 0.0, 0.4), 2.4, 60.0, -20.0)
    for look, sky, reflectance in (
        ("rubber", "2d", 0.0),
        ("water", "2d", 0.0),
        ("model", "skybox", 0.4),
    ):
        model, data = posed(MODEL.format(sky=sky, reflectance=reflectance))
        surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), look)
        with Renderer(shared_context(), model, {1: surface}, size=(200, 160)) as renderer:
            yield renderer.render(data, {1: height_map}, camera)
            image = renderer.surfaces(data, {1: height_map}, camera)
            yield np.concatenate(
                [image.depth[..., None], image.normal, image.height[..., None]], axis=2
            )


class Without:
    """A context without some functions: who calls one ends the process."""

    def __init__(self, context: Any, names: set[str]) -> None:
        self._context = context
        self._names = names

    def load_opengl_function(self, name: str) -> int:
        return 0 if name in self._names else self._context.load(name)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def __enter__(self) -> object:
        return self._context.__enter__()

    def __exit__(self, *error: object) -> None:
        self._context.__exit__(*error)


def draw_in_old_opengl(path: str) -> None:
    """Draw in a process with shaders and functions of OpenGL 4.1 alone."""
    later = [
        importlib.import_module(f"OpenGL.raw.GL.VERSION.GL_4_{minor}") for minor in range(2, 7)
    ]
    names = {name for each in later for name in dir(each) if name.startswith("gl")}
    create = moderngl.create_context

    def older(require: int, standalone: bool, backend: str, **settings: object) -> moderngl.Context:
        context = glcontext.get_backend_by_name(backend)(
            mode="standalone", glversion=require, **settings
        )
        return create(require=require, standalone=standalone, context=Without(context, names))

    moderngl.create_context = older
    np.savez(path, *drawn(), computes=shared_context().computes)


OLDER = {"MESA_GL_VERSION_OVERRIDE": "4.1", "MESA_GLSL_VERSION_OVERRIDE": "410"}


@pytest.fixture
def mesa(gl: GLContext) -> None:
    if "Mesa" not in gl.version:
        pytest.skip("only Mesa can be asked for an older version")


def test_frames_of_an_older_opengl_are_the_same(mesa: None, tmp_path: Path) -> None:
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]; import test_versions as here; "
        "here.draw_in_old_opengl(sys.argv[1])"
    )
    done = ended(
        "-c",
        code,
        tmp_path / "frames.npz",
        Path(__file__).parent,
        *sys.path,
        env={**os.environ, **OLDER},
    )
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "frames.npz") as frames:
        assert not frames["computes"]
        for number, frame in enumerate(drawn()):
            assert np.ptp(frame) > 0
            np.testing.assert_array_equal(frames[f"arr_{number}"], frame)


def test_waves_in_compute_shaders_are_refused_and_auto_takes_the_cpu(mesa: None) -> None:
    code = """if True:
        from ripple_sim.solver import Material, WaveSolver, sphere_atlas
        from ripple_sim.solver.gl import GLContext
        GLContext.software = False
        atlas = sphere_atlas(1.0, 8)
        print(WaveSolver(atlas, Material(), backend="auto").backend)
        WaveSolver(atlas, Material(), backend="gl")
    """
    done = ended("-c", code, env={**os.environ, **OLDER})
    assert done.stdout == "cpu\n"
    assert done.stderr.splitlines()[-1].endswith(
        "has OpenGL 4.1; backend 'gl' needs 4.3: take backend 'cpu'"
    )


# Frames of `test_versions.drawn` without EGL's library, drawn in another thread than the one that
# made the context. A display of X11 gives GLX.
WITHOUT_EGL = """
import os, sys, threading
import numpy as np
sys.path[:0] = sys.argv[2:]
from ripple_sim.solver.gl import creation, current, shared_context
creation.egl_exists = current.egl_exists = lambda: False
gl = shared_context()
assert type(gl._current) is current.GLXCurrent
assert current.GLXCurrent.of_thread() is None  # left again
import test_versions
frames = []
thread = threading.Thread(target=lambda: frames.extend(test_versions.drawn()))
thread.start()
thread.join()
np.savez(sys.argv[1], *frames)
"""


def test_frames_of_glx_are_those_of_egl(opengl: None, screen: str, tmp_path: Path) -> None:
    done = ended(
        "-c",
        WITHOUT_EGL,
        tmp_path / "frames.npz",
        Path(__file__).parent,
        *sys.path,
        env={**os.environ, "DISPLAY": screen},
    )
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "frames.npz") as frames:
        for number, frame in enumerate(drawn()):
            np.testing.assert_array_equal(frames[f"arr_{number}"], frame)
