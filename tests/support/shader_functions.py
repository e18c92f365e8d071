"""Functions of the renderer's shaders, called with many inputs."""

import importlib
import itertools
import shutil
import sys
import tempfile
import weakref
from pathlib import Path

import moderngl
import numpy as np

import ripple_sim.render
from ripple_sim.render import DEFINES
from ripple_sim.solver.gl import GLContext

_PACKAGE = "shaders_under_test"
_WIDTH = 256
_SHADER = """#version 410
#stage vertex
void main()
{{
    gl_Position = vec4(4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2) - 1.0, 0.0, 1.0);
}}
#stage fragment
#include "{include}"
uniform sampler2D given;
out vec4 result;
void main()
{{
    vec4 x = texelFetch(given, ivec2(gl_FragCoord.xy), 0);
    result = {expression};
}}
"""
_folder = tempfile.TemporaryDirectory(prefix="ripple-sim-shaders-")
_numbers = itertools.count()
_cleanup = weakref.finalize(_folder, _folder.cleanup)


def _program(
    gl: GLContext, include: str, expression: str, defines: dict[str, object]
) -> moderngl.Program:
    """A program that includes one of the renderer's files by the real loader."""
    package = Path(_folder.name, _PACKAGE)
    if not package.exists():
        shutil.copytree(
            Path(ripple_sim.render.__file__).parent,
            package,
            ignore=shutil.ignore_patterns("*.py", "__*"),
        )
        (package / "__init__.py").touch()
        sys.path.append(_folder.name)
        importlib.invalidate_caches()
    name = f"under_test_{next(_numbers)}"  # sources are read once
    text = _SHADER.format(include=include, expression=expression)
    (package / f"{name}.glsl").write_text(text)
    return gl.program(_PACKAGE, name, **{**DEFINES, **defines})


def evaluated(
    gl: GLContext, include: str, expression: str, inputs: np.ndarray, **defines: object
) -> np.ndarray:
    """Values [k, 4] of a GLSL expression of `x`, a vec4, at inputs [k, up to 4]; float32."""
    count, columns = inputs.shape
    rows = -(-count // _WIDTH)
    given = np.zeros((rows * _WIDTH, 4), dtype=np.float32)
    given[:count, :columns] = inputs
    with gl as ctx:
        program = _program(gl, include, expression, defines)
        texture = ctx.texture((_WIDTH, rows), 4, given.tobytes(), dtype="f4")
        target = ctx.texture((_WIDTH, rows), 4, dtype="f4")
        picture = ctx.framebuffer([target])
        picture.use()
        ctx.enable_only(0)
        texture.use(0)
        if "given" in program:  # an unused input is optimised away
            program["given"] = 0
        ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        values = np.frombuffer(picture.read(components=4, dtype="f4"), dtype=np.float32)
        ctx.detect_framebuffer(0).use()
    return values.reshape(-1, 4)[:count]
