"""The OpenGL context: created here, entered here, checked here, and nowhere else."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

import moderngl

from ..errors import GLError
from .drivers import is_software
from .egl import create_context, current_context, load_egl, release_current
from .fence import Fences
from .program_pool import ProgramPool
from .shader import load_shader

# How long a thread waits for another to leave the context [s]: longer than any frame takes.
_PATIENCE = 120.0

# How long a thread that waits for the driver keeps others from the context [s], and how long it leaves it to them: a
# lock that is let go and taken at once is not handed on.
_TURN, _PAUSE = 1e-3, 1e-4


class GLContext:
    """One headless OpenGL 4.3 context on EGL, shared by the GPU wave solver and the renderer.

    Use it as a context manager: entering makes the context current, frees the objects that Python has collected, and
    returns the `moderngl.Context`; leaving the outermost block restores the previous context and raises `GLError` if
    the driver recorded an error meanwhile. Any thread may enter: one at a time, the others wait.

    Parameters
    ----------
    device : int, optional
        EGL device index. By default the first device that yields a context.

    Raises
    ------
    GLError
        If no EGL device gives an OpenGL 4.3 core context; at entering, if the context was lost, if another thread does
        not leave it, or in a process that was forked.
    """

    def __init__(self, device: int | None = None) -> None:
        self._process, self._lock, self._owner = os.getpid(), threading.RLock(), ""
        self._ctx = create_context(device)
        # objects may be collected in any thread, at any time; they are freed when the context is next entered
        self._ctx.gc_mode = "context_gc"
        self._handle = current_context()
        info = self._ctx.info
        self.renderer: str = info["GL_RENDERER"]
        self.vendor: str = info["GL_VENDOR"]
        self.version: str = info["GL_VERSION"]
        self._depth = 0
        self._fences = Fences(load_egl().eglGetProcAddress)
        self._shared_shaders: dict[str, moderngl.ComputeShader] = {}
        self._before: int | None = None
        self._pool = ProgramPool()
        release_current()

    @property
    def software(self) -> bool:
        """Whether the driver renders on the CPU. EGL falls back to that without saying so."""
        return is_software(self.renderer)

    def __enter__(self) -> moderngl.Context:
        self.check_process()
        if not self._lock.acquire(timeout=_PATIENCE):
            raise GLError(
                f"thread {self._owner!r} has held the OpenGL context on {self.renderer} for {_PATIENCE:g} s, and "
                f"thread {threading.current_thread().name!r} cannot enter it; leave the context's `with` block before "
                "waiting for another thread that needs it"
            )
        try:
            if self._depth == 0:
                self._take()
        except BaseException:
            self._lock.release()
            raise
        self._depth += 1
        return self._ctx

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, traceback: Any) -> None:
        self._depth -= 1
        try:
            if not self._depth:
                self._leave(error)
        finally:
            self._lock.release()

    def check_process(self) -> None:
        """Raise `GLError` in a process that was forked: a context does not survive that."""
        if os.getpid() != self._process:
            raise GLError(
                f"the OpenGL context belongs to process {self._process}, of which this one ({os.getpid()}) is a fork; "
                "start processes with multiprocessing's method 'spawn', or take backend 'cpu'"
            )

    def _take(self) -> None:
        self._owner, self._before = threading.current_thread().name, current_context()
        self._ctx.__enter__()
        if current_context() != self._handle:
            raise GLError(
                f"the OpenGL context on {self.renderer} is lost; something else in this process has shut EGL "
                "down (a pyvista or VTK window does): run one of the two in a process of its own"
            )
        self._free()

    def _leave(self, error: BaseException | None) -> None:
        recorded = self._ctx.error
        self._ctx.__exit__(None, None, None)
        if self._before is None:
            release_current()
        if recorded == "GL_OUT_OF_MEMORY":
            raise GLError(
                f"{self.renderer} is out of memory: take a lower resolution or smaller frames, or backend 'cpu'"
            ) from error
        if isinstance(error, moderngl.Error):
            raise GLError(f"OpenGL failed on {self.renderer}: {error}; see `ripple-sim info`") from error
        if recorded != "GL_NO_ERROR" and error is None:
            raise GLError(f"OpenGL reported {recorded} on {self.renderer}; see `ripple-sim info`")

    def barrier(self) -> None:
        """Make what compute shaders have written visible to later commands."""
        with self as ctx:
            ctx.memory_barrier()

    def wait(self) -> None:
        """Wait until the driver has finished all commands, without blocking other Python threads.

        moderngl holds the interpreter's lock while it waits, in `finish` as well as in reading back.
        """
        self.wait_for(self.put_fence())

    def put_fence(self) -> int:
        """Put a fence behind all commands so far, and return its handle; wait for each fence once."""
        with self:
            return self._fences.put()

    def wait_for(self, fence: int) -> None:
        """Wait until the driver has reached a fence, as `wait` does for all commands.

        Outside of the context's `with` block other threads may enter meanwhile.
        """
        reached = False
        while not reached:
            with self:
                reached = self._fences.reached(fence, _TURN)
            if not reached:
                time.sleep(_PAUSE)

    def compute_shader(self, package: str, name: str, **defines: object) -> moderngl.ComputeShader:
        """Compile `{name}.glsl` below `package` as a compute shader; see `load_shader`."""
        source = load_shader(package, name, **defines)
        with self:
            return self._pool.take((source,), lambda: self._compute_shader(name, source))

    def shared_compute_shader(self, package: str, name: str, **defines: object) -> moderngl.ComputeShader:
        """Compile a compute shader once and share it: set all uniforms before each use."""
        source = load_shader(package, name, **defines)
        if source not in self._shared_shaders:
            self._shared_shaders[source] = self._compute_shader(name, source)
        return self._shared_shaders[source]

    def program(self, package: str, vertex: str, fragment: str, **defines: object) -> moderngl.Program:
        """Compile and link a vertex and a fragment shader from below `package`; see `load_shader`."""
        vertex_source = load_shader(package, vertex, **defines)
        fragment_source = load_shader(package, fragment, **defines)
        with self as ctx:
            return self._pool.take(
                (vertex_source, fragment_source),
                lambda: _compiled(
                    f"{vertex} + {fragment}",
                    lambda: ctx.program(vertex_shader=vertex_source, fragment_shader=fragment_source),
                ),
            )

    def release(self, created: Any) -> None:
        """Release an object; programs and compute shaders are kept for whoever asks for the same ones next."""
        with self:
            if isinstance(created, moderngl.Program | moderngl.ComputeShader):
                created = self._pool.give_back(created)
            if created is not None:
                created.release()

    def _compute_shader(self, name: str, source: str) -> moderngl.ComputeShader:
        with self as ctx:
            return _compiled(name, lambda: ctx.compute_shader(source))

    def _free(self) -> None:
        """Free the objects that Python has collected; `moderngl.Context.gc` fails on those released by hand."""
        while self._ctx.objects:
            collected = self._ctx.objects.popleft()
            if hasattr(collected, "release"):
                collected.release()


def _compiled(name: str, compile_shader: Callable[[], Any]) -> Any:
    try:
        return compile_shader()
    except moderngl.Error as error:
        raise GLError(f"shader {name} does not compile: {error}") from error
