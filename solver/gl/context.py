"""The OpenGL context: created here, entered here, checked here, and nowhere else.

`shared_context` gives the one context of a device that all in the process share. Beside it: software drivers, to which
EGL falls back without saying so; fences, which moderngl lacks, to wait for the GPU without blocking other Python
threads; and a pool of programs that nobody uses at the time, for compiling one takes as long as a frame.

`load_shader` reads GLSL sources from packages, resolves their includes, and defines the constants that Python gives.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import importlib.resources
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import moderngl

from ..errors import GLError


def load_shader(package: str, name: str, stage: str = "", **defines: object) -> str:
    """Read a shader, resolve its includes, and put the defines behind `#version`.

    Parameters
    ----------
    package : str
        The package below which the shader and whatever it includes lie.
    name : str
        Path of the file below the package, without `.glsl`: "passes/classify". A line `#include "glsl/frame.glsl"` is
        replaced by that file, its path likewise relative to the package; a file that was included before is not
        included again.
    stage : str
        Which of the shaders in the file, if there are several: lines behind `#stage vertex` belong to the stage
        "vertex" alone, up to the next such line; those before the first belong to all. So it is in files included.
    **defines
        Constants, written as `#define NAME value` where the text has the name. GROUP is how many threads a group of a
        compute shader has, which is declared too.

    Raises
    ------
    GLError
        If a file is missing, or the shader does not start with `#version`.
    """
    text = _read(importlib.resources.files(package), f"{name}.glsl", stage, set())
    head, _, body = text.partition("\n")
    if not head.startswith("#version"):
        raise GLError(f"shader {name}.glsl of {package} must start with #version, found {head!r}")
    # only those that it knows: shaders that do not differ in them are the same, and compiled once
    known = set(re.findall(r"\w+", " ".join([body, *map(str, defines.values())])))
    lines = "".join(f"#define {key} {value}\n" for key, value in defines.items() if key in known)
    layout = f"layout(local_size_x = {defines['GROUP']}) in;\n" if "GROUP" in defines else ""
    return f"{head}\n{lines}{layout}{body}"


def _read(folder: Traversable, path: str, stage: str, seen: set[str]) -> str:
    """Text of a file with what it includes, as far as it belongs to a stage, unless it has been seen."""
    if path in seen:
        return ""
    seen.add(path)
    file = folder.joinpath(path)
    if not file.is_file():
        raise GLError(f"package {folder.name} has no shader {path}")
    lines, belongs = [], True
    for line in _lines(file):  # type: ignore[arg-type]  # a path can be hashed
        if line.startswith("#stage"):
            belongs = line.split()[1] == stage
        elif belongs:
            lines.append(_read(folder, line.split('"')[1], stage, seen) if line.startswith("#include") else line)
    return "\n".join(lines) + "\n"


@functools.cache  # a batch makes a renderer for every scene
def _lines(file: Traversable) -> list[str]:
    return file.read_text().splitlines()


# The number that a shader gives to a sampler or uniform block, and its name; and what is to be left out of it.
_BOUND = re.compile(r"layout\((?:std140, )?binding = (\w+)\) uniform (?:\w+ )?(\w+)")
_BINDING = re.compile(r"layout\(binding = \w+\) |, binding = \w+")

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swr", "software")


def is_software(renderer: str) -> bool:
    """Whether a driver renders on the processor, by its GL_RENDERER."""
    return any(word in renderer.lower() for word in _SOFTWARE)


# The plain sonames first; the versioned ones are what runtime packages without -dev symlinks install.
_LIBRARIES: tuple[dict[str, str], ...] = ({}, {"libegl": "libEGL.so.1", "libgl": "libGL.so.1"})

# Versions of OpenGL that compute shaders need, and that rendering needs.
COMPUTE, RENDERING = 430, 410

# What Mesa's shader cache may come to need while a process runs [bytes].
_SHADER_CACHE = 64e6


def _spare_full_disks() -> None:
    """Switch Mesa's shader cache off where its disk is nearly full, or its folder cannot be made.

    It is mapped, and a page without room kills; of a folder Mesa complains on standard error.
    """
    names = ("MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
    folder = Path(next((os.environ[name] for name in names if os.environ.get(name)), "/"))
    with contextlib.suppress(OSError):
        there = next(each for each in (folder, *folder.parents) if each.exists())
        if shutil.disk_usage(there).free < _SHADER_CACHE or not os.access(there, os.W_OK):
            os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")


def create_context(device: int | None) -> moderngl.Context:
    """Create a headless context on a device, or the first that yields one: OpenGL 4.3, or else 4.1; raises GLError."""
    if not sys.platform.startswith("linux"):
        raise GLError(f"no OpenGL over EGL on {sys.platform}, as rendering and 'gl' need; waves run with backend 'cpu'")
    _spare_full_disks()
    devices = range(8) if device is None else [device]
    reason = "no device"
    for version in (COMPUTE, RENDERING, 330):  # drivers may give the very version that is asked for
        for libraries in _LIBRARIES:
            for index in devices:
                settings: dict[str, Any] = {"backend": "egl", "device_index": index, **libraries}  # not in its hints
                try:
                    ctx = moderngl.create_context(require=version, standalone=True, **settings)
                except Exception as error:  # moderngl raises bare Exception here
                    reason = str(error)
                    if "not loaded" in reason:
                        break
                    continue
                if version >= RENDERING:
                    return ctx
                raise GLError(
                    f"{ctx.info['GL_RENDERER']} has OpenGL {ctx.version_code / 100:.1f}; rendering needs 4.1 or later, "
                    "backend 'gl' 4.3: update the driver, or take Mesa's llvmpipe (LIBGL_ALWAYS_SOFTWARE=1); waves "
                    "alone run with backend 'cpu'"
                )
    if device is not None:
        raise GLError(f"no OpenGL 4.1 context on EGL device {device} ({reason}); devices are counted from 0")
    advice = "install Mesa with: apt-get install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0"
    raise GLError(f"no OpenGL 4.1 context on any EGL device ({reason}); {advice}")


def current_context() -> int | None:
    """Handle of the EGL context that is current in this thread; None if there is none."""
    return load_egl().eglGetCurrentContext()


def release_current() -> None:
    """Leave this thread without a current context, so that another thread may take it."""
    egl = load_egl()
    egl.eglMakeCurrent(egl.eglGetCurrentDisplay(), None, None, None)


@functools.cache
def load_egl() -> ctypes.CDLL:
    """The EGL library that moderngl has loaded already."""
    for libraries in _LIBRARIES:
        with contextlib.suppress(OSError):
            egl = ctypes.CDLL(libraries.get("libegl", "libEGL.so"))
            for function in (egl.eglGetCurrentContext, egl.eglGetCurrentDisplay, egl.eglGetProcAddress):
                function.restype = ctypes.c_void_p
            egl.eglMakeCurrent.argtypes = [ctypes.c_void_p] * 4
            return egl
    raise GLError("the EGL library is gone since the context was created; see `ripple-sim info`")


_COMMANDS_COMPLETE = 0x9117  # GL_SYNC_GPU_COMMANDS_COMPLETE
_FLUSH = 0x1  # GL_SYNC_FLUSH_COMMANDS_BIT
_TIMEOUT_EXPIRED, _FAILED = 0x911B, 0x911D

_MOST = 64  # idle programs at a time

# How long a thread waits for another to leave the context [s]: longer than any frame takes.
_PATIENCE = 120.0

# How long a thread that waits for the driver keeps others from the context [s], and how long it leaves it to them: a
# lock that is let go and taken at once is not handed on.
_TURN, _PAUSE = 1e-3, 1e-4


class GLContext:
    """One headless OpenGL context on EGL, shared by the GPU wave solver and the renderer.

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
        If no EGL device gives an OpenGL 4.1 core context; at entering, if the context was lost, if another thread does
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
        self.computes = self._ctx.version_code >= COMPUTE
        self._depth = 0
        # fences, which moderngl lacks; ctypes lets go of the interpreter's lock while they are waited for
        pointer, number, address = ctypes.c_void_p, ctypes.c_uint, load_egl().eglGetProcAddress
        self._create_fence = ctypes.CFUNCTYPE(pointer, number, number)(address(b"glFenceSync"))
        self._client_wait = ctypes.CFUNCTYPE(number, pointer, number, ctypes.c_uint64)(address(b"glClientWaitSync"))
        self._delete_fence = ctypes.CFUNCTYPE(None, pointer)(address(b"glDeleteSync"))
        self._shaders: dict[str, moderngl.ComputeShader] = {}
        self._before: int | None = None
        # programs that nobody uses, by their number in OpenGL, the longest idle first; of all, the sources and the
        # uniforms that they began with
        self._idle: dict[int, Any] = {}
        self._begun: dict[int, tuple[tuple[str, ...], dict[str, bytes]]] = {}
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
            if self._depth:
                return
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
        # what Python has collected; `moderngl.Context.gc` fails on objects released by hand
        while self._ctx.objects:
            collected = self._ctx.objects.popleft()
            if hasattr(collected, "release"):
                collected.release()

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
            return self._create_fence(_COMMANDS_COMPLETE, 0)

    def wait_for(self, fence: int) -> None:
        """Wait until the driver has reached a fence, as `wait` does for all commands; the fence is then deleted.

        Outside of the context's `with` block other threads may enter meanwhile. Raises `GLError` if the driver reports
        a failure.
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
        """Compile a stage of `{name}.glsl` below `package` once and share it: set all uniforms before each use."""
        if not self.computes:
            raise GLError(
                f"{self.renderer} has OpenGL {self.version.split()[0]}; backend 'gl' needs 4.3: take backend 'cpu'"
            )
        source = load_shader(package, name, stage, **defines)
        if source not in self._shaders:
            with self as ctx:
                self._shaders[source] = _compiled(name, lambda: ctx.compute_shader(source))
        return self._shaders[source]

    def program(self, package: str, name: str, *captured: str, **defines: object) -> moderngl.Program:
        """Compile and link the stages "vertex" and "fragment" of `{name}.glsl` below `package`; see `load_shader`.

        An idle program of the same text is taken instead, its uniforms as after compilation.

        `VARYING` is what the one hands to the other: `out` and `in`. With `captured`, names of outputs of the
        vertex stage, there is no other, and transform feedback captures these. A shader may say `binding = N` of its
        samplers and uniform blocks, each by a name of its own: GLSL has that from 4.2 on, and here it is done.
        """
        stages = {"vertex": "out"} if captured else {"vertex": "out", "fragment": "in"}
        texts = [load_shader(package, name, stage, VARYING=way, **defines) for stage, way in stages.items()]
        found = [each for text in texts for each in _BOUND.findall(text)]
        bindings = {bound: int(str(defines.get(number, number))) for number, bound in found}
        vertex, *fragment = (_BINDING.sub("", text) for text in texts)

        def linked() -> moderngl.Program:
            program = ctx.program(vertex_shader=vertex, fragment_shader=next(iter(fragment), None), varyings=captured)
            for each in bindings.keys() & set(program):
                member = program[each]
                setattr(member, "value" if isinstance(member, moderngl.Uniform) else "binding", bindings[each])
            return program

        sources = vertex, *fragment, *captured
        with self as ctx:
            number = next((each for each in reversed(self._idle) if self._begun[each][0] == sources), None)
            if number is None:
                program = _compiled(name, linked)
                uniforms = [each for each in program if isinstance(program[each], moderngl.Uniform)]
                self._begun[program.glo] = sources, {each: program[each].read() for each in uniforms}
                return program
            for each, value in self._begun[number][1].items():
                self._idle[number][each].write(value)
            return self._idle.pop(number)

    def release(self, created: Any) -> None:
        """Release an object; programs are kept for whoever asks for the same ones next, up to a number."""
        with self:
            if isinstance(created, moderngl.Program) and created.glo in self._begun:
                self._idle[created.glo] = created
                if len(self._idle) <= _MOST:
                    return
                oldest = next(iter(self._idle))
                del self._begun[oldest]
                created = self._idle.pop(oldest)
            created.release()


def _compiled(name: str, compile_shader: Callable[[], Any]) -> Any:
    try:
        return compile_shader()
    except moderngl.Error as error:
        raise GLError(f"shader {name} does not compile: {error}") from error


_shared: dict[int | None, GLContext] = {}
_selected: int | None = None
_lock = threading.Lock()


def select_device(device: int | None) -> None:
    """Select the EGL device of `shared_context`; None: the first that yields a context."""
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
