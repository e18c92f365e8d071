"""The OpenGL context: entered here, checked here, and nowhere else.

`shared_context` gives the context of a device that the whole process shares. This module also has
fences, which moderngl lacks, to wait for the GPU without blocking other Python threads; and it
keeps a pool of idle programs, since compiling a program takes as long as a frame.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import moderngl

from ..errors import GLError
from .creation import COMPUTE, create_context, is_software
from .current import Restore, replace_current
from .shader_text import load_shader

# The binding that a shader gives to a sampler or uniform block, and the name of the latter.
_BOUND = re.compile(r"layout\((?:std140, )?binding = (\w+)\) uniform (?:\w+ )?(\w+)")

# The part of such a declaration that GLSL before 4.2 does not have.
_BINDING = re.compile(r"layout\(binding = \w+\) |, binding = \w+")

# Constants of OpenGL for fences.
_COMMANDS_COMPLETE = 0x9117  # GL_SYNC_GPU_COMMANDS_COMPLETE
_FLUSH = 0x1  # GL_SYNC_FLUSH_COMMANDS_BIT
_TIMEOUT_EXPIRED = 0x911B  # GL_TIMEOUT_EXPIRED
_FAILED = 0x911D  # GL_WAIT_FAILED

_MAX_IDLE_PROGRAMS = 64

# Time that a thread waits for another thread to leave the context [s]: longer than any frame takes.
_PATIENCE = 120.0

# A thread that waits for the driver holds the context for a turn [s], and then leaves it to other
# threads for a pause [s]: a lock that is released and taken at once is not handed on.
_TURN = 1e-3
_PAUSE = 1e-4


class GLContext:
    """One headless OpenGL context, shared by the GPU wave solver and the renderer.

    Use it as a context manager. Entering makes the context current, frees discarded objects, and
    returns the `moderngl.Context`. Leaving the outermost block makes the program's own context
    current again, and raises `GLError` if the driver recorded an error meanwhile. Any thread may
    enter: one at a time, other threads wait.

    Python collects objects at any time, in any thread, also in the middle of a frame. So finalizers
    do not call OpenGL: they `discard` objects, which are freed when the context is next entered
    from outside.

    Parameters
    ----------
    device : int, optional
        EGL device index. By default the index in the environment variable MUJOCO_EGL_DEVICE_ID, or
        the first device that yields a context.

    Raises
    ------
    GLError
        If there is no OpenGL 4.1 core context; at entering, if the context was lost, if
        another thread does not leave it, or in a process that was forked.
    """

    def __init__(self, device: int | None = None) -> None:
        self._process = os.getpid()
        self._lock = threading.RLock()
        self._owner = ""  # name of the thread that has entered
        self._depth = 0  # number of its nested `with` blocks
        self._restore: Restore | None = None  # makes the program's own context current again
        self._collected_before = True  # whether Python's garbage collector was on before entering
        # batches of objects to free
        self._discarded: deque[list[Any]] = deque()
        self._shaders: dict[str, moderngl.ComputeShader] = {}
        # idle programs by their number in OpenGL, the longest idle first
        self._idle: dict[int, Any] = {}
        # of all programs: the sources, and the uniforms after compilation
        self._programs: dict[int, tuple[tuple[str, ...], dict[str, bytes]]] = {}
        created = create_context(device)
        self._ctx = created.ctx
        self._current = created.current
        self.renderer: str = created.info["GL_RENDERER"]
        self.vendor: str = created.info["GL_VENDOR"]
        self.version: str = created.info["GL_VERSION"]
        self.computes = self._ctx.version_code >= COMPUTE
        self._find_fences(created.address_of)
        # moderngl's objects wait in `objects` once they are collected
        self._ctx.gc_mode = "context_gc"
        with self as ctx:
            self._no_framebuffer = ctx.detect_framebuffer(0)

    def _find_fences(self, address_of: Callable[[str], int]) -> None:
        """Find OpenGL's fences, which moderngl lacks.

        ctypes lets go of the interpreter's lock while a fence is waited for.
        """
        pointer = ctypes.c_void_p
        number = ctypes.c_uint
        self._create_fence = ctypes.CFUNCTYPE(pointer, number, number)(address_of("glFenceSync"))
        self._client_wait = ctypes.CFUNCTYPE(number, pointer, number, ctypes.c_uint64)(
            address_of("glClientWaitSync")
        )
        self._flush = ctypes.CFUNCTYPE(None)(address_of("glFlush"))
        self._delete_fence = ctypes.CFUNCTYPE(None, pointer)(address_of("glDeleteSync"))

    @property
    def software(self) -> bool:
        """Whether the driver renders on the CPU. EGL falls back to such a driver silently."""
        return is_software(self.renderer)

    def __enter__(self) -> moderngl.Context:
        self.check_process()
        if not self._lock.acquire(timeout=_PATIENCE):
            raise GLError(
                f"thread {self._owner!r} has held the OpenGL context on {self.renderer} for "
                f"{_PATIENCE:g} s, and "
                f"thread {threading.current_thread().name!r} cannot enter it; leave the context's "
                f"`with` block before "
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: Any
    ) -> None:
        self._depth -= 1
        try:
            if self._depth:
                return
            taken = not self._current.is_current()
            recorded = "GL_NO_ERROR" if taken else self._ctx.error
            self._leave()
            if taken and error is None:
                raise GLError(
                    f"the OpenGL context on {self.renderer} was left while it drew: something "
                    f"else, such as the "
                    "finalizer of a mujoco.Renderer, made another context current; what was drawn "
                    "is incomplete. "
                    "Close other renderers instead of leaving them to be collected"
                )
            if recorded == "GL_OUT_OF_MEMORY":
                raise GLError(
                    f"{self.renderer} is out of memory: take a lower resolution or smaller frames, "
                    f"or backend 'cpu'"
                ) from error
            if isinstance(error, moderngl.Error):
                raise GLError(
                    f"OpenGL failed on {self.renderer}: {error}; see `ripple-sim info`"
                ) from error
            if recorded != "GL_NO_ERROR" and error is None:
                raise GLError(
                    f"OpenGL reported {recorded} on {self.renderer}; see `ripple-sim info`"
                )
        finally:
            self._lock.release()

    def check_process(self) -> None:
        """Raise `GLError` in a process that was forked: a context does not survive a fork."""
        if os.getpid() != self._process:
            raise GLError(
                f"the OpenGL context belongs to process {self._process}, of which this one "
                f"({os.getpid()}) is a fork; "
                "start processes with multiprocessing's method 'spawn', or take backend 'cpu'"
            )

    def _take(self) -> None:
        """Make the context current, and free discarded objects."""
        self._owner = threading.current_thread().name
        if self._current.is_current():  # Ctrl-C left it current: other threads could not enter
            self._current.leave()
        # finalizers of other libraries would leave the context at any line: those of MuJoCo call
        # eglReleaseThread
        self._collected_before = gc.isenabled()
        gc.disable()
        try:
            self._take_current()
            self._free_discarded()
        except BaseException:
            self._leave()
            raise

    def _take_current(self) -> None:
        """Make the context current; raise `GLError` if it is lost."""
        restore = replace_current(self._current)
        if restore is None:
            raise GLError(
                f"the OpenGL context on {self.renderer} is lost; something else in this process "
                "has shut EGL down (a pyvista or VTK window does): run one of the two in a "
                "process of its own"
            )
        self._restore = restore

    def _leave(self) -> None:
        """Make the program's own context current again."""
        restore = self._restore
        self._restore = None
        try:
            if restore is not None:
                restore()
        finally:
            if self._collected_before:
                gc.enable()

    def discard(self, objects: list[Any]) -> None:
        """Have objects of moderngl freed when the context is next entered from outside.

        It does not call OpenGL and does not wait: finalizers may call it, in any thread and in the
        middle of a frame.
        """
        self._discarded.append(objects)

    def free(self) -> None:
        """Free discarded objects now, or later if a thread uses the context."""
        if os.getpid() != self._process or not self._lock.acquire(blocking=False):
            return
        try:
            if self._depth == 0:
                with contextlib.suppress(GLError), self:  # a lost context has no objects
                    pass
        finally:
            self._lock.release()

    def _free_discarded(self) -> None:
        collected = self._ctx.objects
        if not (self._discarded or collected):
            return
        self._no_framebuffer.use()  # a framebuffer that is deleted must not stay bound
        while self._discarded:
            for discarded in reversed(self._discarded.popleft()):
                self._release(discarded)
        while collected:  # `moderngl.Context.gc` fails on objects released by hand
            last = collected.popleft()
            if hasattr(last, "release"):
                last.release()

    def barrier(self) -> None:
        """Make the results of compute shaders visible to later commands."""
        with self as ctx:
            ctx.memory_barrier()

    def flush(self) -> None:
        """Have a software driver draw all commands so far, without blocking other Python threads.

        Otherwise a software driver draws a pass when the next pass begins, in a call of moderngl
        that holds the interpreter's lock. Other drivers begin on their own.
        """
        if self.software:
            self._flush()

    def wait(self) -> None:
        """Wait until the driver has finished all commands, without blocking other Python threads.

        moderngl holds the interpreter's lock while it waits, in `finish` as well as in reading
        back.
        """
        self.wait_for(self.put_fence())

    def put_fence(self) -> int:
        """Put a fence behind all commands so far, and return its handle.

        Wait for each fence once.
        """
        with self:
            return self._create_fence(_COMMANDS_COMPLETE, 0)

    def wait_for(self, fence: int) -> None:
        """Wait until the driver has reached a fence, and delete the fence.

        Other threads may enter the context meanwhile, unless this thread is in its `with` block.
        Raises `GLError` if the driver reports a failure.
        """
        while True:
            with self:
                state = _FAILED
                try:
                    state = self._client_wait(fence, _FLUSH, round(1e9 * _TURN))
                finally:
                    if state != _TIMEOUT_EXPIRED:
                        self._delete_fence(fence)
                if state == _FAILED:
                    raise GLError("OpenGL cannot wait for its own commands; see `ripple-sim info`")
            if state != _TIMEOUT_EXPIRED:
                return
            time.sleep(_PAUSE)

    def compute_shader(
        self, package: str, name: str, stage: str = "compute", /, **defines: object
    ) -> moderngl.ComputeShader:
        """Compile a stage of `{name}.glsl` below `package`, once for all callers.

        Set all uniforms before each use.
        """
        if not self.computes:
            raise GLError(
                f"{self.renderer} has OpenGL {self.version.split()[0]}; backend 'gl' needs 4.3: "
                f"take backend 'cpu'"
            )
        source = load_shader(package, name, stage, **defines)
        if source not in self._shaders:
            with self as ctx:
                self._shaders[source] = _compiled(name, lambda: ctx.compute_shader(source))
        return self._shaders[source]

    def program(
        self, package: str, name: str, *captured: str, **defines: object
    ) -> moderngl.Program:
        """Compile and link the stages "vertex" and "fragment" of `{name}.glsl` below `package`.

        See `load_shader`. An idle program of the same text is taken instead, with its uniforms as
        after compilation.

        `VARYING` declares a value that the vertex stage passes to the fragment stage: it is `out`
        in the one and `in` in the other. With `captured`, names of outputs of the vertex stage,
        there is no fragment stage, and transform feedback captures these outputs. A shader may give
        `binding = N` to its samplers and uniform blocks, each of which has a name of its own. GLSL
        knows bindings from 4.2 on; here they are set for older versions.
        """
        stages = {"vertex": "out"} if captured else {"vertex": "out", "fragment": "in"}
        texts = [
            load_shader(package, name, stage, VARYING=way, **defines)
            for stage, way in stages.items()
        ]
        bindings: dict[str, int] = {}
        for text in texts:
            for number, bound in _BOUND.findall(text):
                bindings[bound] = int(str(defines.get(number, number)))
        vertex, *fragment = (_BINDING.sub("", text) for text in texts)
        sources = vertex, *fragment, *captured
        with self as ctx:
            idle = self._take_idle(sources)
            if idle is not None:
                return idle

            def link() -> moderngl.Program:
                return ctx.program(
                    vertex_shader=vertex,
                    fragment_shader=next(iter(fragment), None),
                    varyings=captured,
                )

            program = _compiled(name, link)
            _bind(program, bindings)
            uniforms = {}
            for member in program:
                if isinstance(program[member], moderngl.Uniform):
                    uniforms[member] = program[member].read()
            self._programs[program.glo] = sources, uniforms
            return program

    def _take_idle(self, sources: tuple[str, ...]) -> moderngl.Program | None:
        """The latest idle program of these sources, with its first uniforms, or None."""
        for number in reversed(self._idle):
            program_sources, uniforms = self._programs[number]
            if program_sources == sources:
                program = self._idle.pop(number)
                for uniform, value in uniforms.items():
                    program[uniform].write(value)
                return program
        return None

    def release(self, created: Any) -> None:
        """Release an object; a number of idle programs is kept for the next caller of `program`."""
        with self:
            self._release(created)

    def _release(self, created: Any) -> None:
        if isinstance(created, moderngl.Program) and created.glo in self._programs:
            self._idle[created.glo] = created
            if len(self._idle) <= _MAX_IDLE_PROGRAMS:
                return
            oldest = next(iter(self._idle))
            del self._programs[oldest]
            created = self._idle.pop(oldest)
        created.release()


def _bind(program: moderngl.Program, bindings: dict[str, int]) -> None:
    """Give samplers and uniform blocks their bindings, by name."""
    for name in bindings.keys() & set(program):
        member = program[name]
        attribute = "value" if isinstance(member, moderngl.Uniform) else "binding"
        setattr(member, attribute, bindings[name])


def _compiled(name: str, compile_shader: Callable[[], Any]) -> Any:
    try:
        return compile_shader()
    except moderngl.Error as error:
        raise GLError(f"shader {name} does not compile: {error}") from error


_shared: dict[int | None, GLContext] = {}
_selected: int | None = None
_lock = threading.Lock()


def _begin_fork() -> None:
    """Give a fork a new lock: a thread that held the lock does not exist in the fork."""
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_fork)


def select_device(device: int | None) -> None:
    """Select the EGL device of `shared_context`; None: as for `create_context`."""
    global _selected
    with _lock:
        _selected = device


def shared_context() -> GLContext:
    """Return the process-wide context of the selected device, created at the first call."""
    with _lock:
        if _selected not in _shared:
            _shared[_selected] = GLContext(_selected)
        _shared[_selected].check_process()
        return _shared[_selected]
