"""Objects on the GPU that are released together."""

from __future__ import annotations

import contextlib
import weakref
from typing import Any

import moderngl

from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext

from .contract import DEFINES

_PACKAGE = "ripple_sim.render"


class Resources:
    """Creates objects on the GPU and releases all of them at once, at the latest when their owner is collected.

    It has the methods of `moderngl.Context` that create something (`buffer`, `texture`, ...).

    Parameters
    ----------
    gl : GLContext
    owner : object
        Whoever uses the objects.

    Attributes
    ----------
    gl : GLContext
    """

    def __init__(self, gl: GLContext, owner: object) -> None:
        self.gl = gl
        self._created: list[Any] = []
        self._finalizer = weakref.finalize(owner, _release, gl, self._created)
        self._finalizer.atexit = False

    def __getattr__(self, name: str) -> Any:
        def create(*arguments: Any, **options: Any) -> Any:
            with self.gl as ctx:
                return self._own(getattr(ctx, name)(*arguments, **options))

        return create

    def program(self, vertex: str, fragment: str, **options: object) -> moderngl.Program:
        """Program of two of the renderer's shaders, by their paths; `options` are defines beside the contract."""
        defines = {"HOLD_UNIFORMS": int(self.gl.software), **DEFINES, **options}
        return self._own(self.gl.program(_PACKAGE, vertex, fragment, **defines))

    def compute_shader(self, name: str, **options: object) -> moderngl.ComputeShader:
        """One of the renderer's compute shaders, likewise."""
        return self._own(self.gl.compute_shader(_PACKAGE, name, **DEFINES, **options))

    def release(self) -> None:
        """Release everything; a second time does nothing."""
        self._finalizer()

    def _own(self, created: Any) -> Any:
        self._created.append(created)
        return created


def _release(gl: GLContext, created: list[Any]) -> None:
    with contextlib.suppress(GLError), gl as ctx:  # nothing is left of a lost context
        # a deleted framebuffer must not stay bound
        ctx.detect_framebuffer(0).use()
        for each in reversed(created):
            gl.release(each)
        created.clear()
