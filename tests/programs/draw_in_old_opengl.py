"""Draw with shaders and functions of OpenGL 4.1 alone: python draw_in_old_opengl.py RESULT.

RESULT is an .npz file of the frames of `floor_scenes`, and whether compute shaders are used.
Mesa's version overrides must ask for OpenGL 4.1.
"""

import importlib
import sys
from typing import Any

import glcontext
import moderngl
import numpy as np
from floor_scenes import floor_frames

from ripple_sim.solver.gl import shared_context


class ContextWithout:
    """A context without some functions: a program that calls one of them ends."""

    def __init__(self, context: Any, missing: set[str]) -> None:
        self._context = context
        self._missing = missing

    def load_opengl_function(self, name: str) -> int:
        return 0 if name in self._missing else self._context.load(name)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def __enter__(self) -> object:
        return self._context.__enter__()

    def __exit__(self, *error: object) -> None:
        self._context.__exit__(*error)


def functions_after_4_1() -> set[str]:
    """Names of the functions that OpenGL 4.2 to 4.6 added."""
    versions = [
        importlib.import_module(f"OpenGL.raw.GL.VERSION.GL_4_{minor}") for minor in range(2, 7)
    ]
    return {name for version in versions for name in dir(version) if name.startswith("gl")}


create_context = moderngl.create_context
missing = functions_after_4_1()


def create_old_context(
    require: int, standalone: bool, backend: str, **settings: object
) -> moderngl.Context:
    create_native = glcontext.get_backend_by_name(backend)
    native = create_native(mode="standalone", glversion=require, **settings)
    context = ContextWithout(native, missing)
    return create_context(require=require, standalone=standalone, context=context)


moderngl.create_context = create_old_context
np.savez(sys.argv[1], *floor_frames(), computes=shared_context().computes)
