"""Objects on the GPU that are released together."""

from __future__ import annotations

import contextlib
import weakref
from typing import Any

from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext


class OwnedObjects:
    """A context that remembers what it makes, so that all of it can be released at once.

    It has the methods of `moderngl.Context` that make something (`buffer`, `texture`, ...). What still lives when the
    owner goes out of use is released then.

    Parameters
    ----------
    gl : GLContext
    owner : object
        Whoever uses the objects.
    """

    def __init__(self, gl: GLContext, owner: object) -> None:
        self._gl = gl
        self._made: list[Any] = []
        self._finalizer = weakref.finalize(owner, _release, gl, self._made)
        self._finalizer.atexit = False

    def __getattr__(self, name: str) -> Any:
        def make(*arguments: Any, **options: Any) -> Any:
            with self._gl as ctx:
                return self.own(getattr(ctx, name)(*arguments, **options))

        return make

    def own(self, made: Any) -> Any:
        """Remember an object that was made elsewhere, and return it."""
        self._made.append(made)
        return made

    def release(self) -> None:
        """Release everything; a second time does nothing."""
        self._finalizer()


def _release(gl: GLContext, made: list[Any]) -> None:
    with contextlib.suppress(GLError), gl as ctx:  # of a lost context nothing is left to release
        # a deleted framebuffer must not stay bound
        ctx.detect_framebuffer(0).use()
        for each in reversed(made):
            each.release()
        made.clear()
