"""The OpenGL context: created here, entered here, checked here, and nowhere else."""

from __future__ import annotations

import contextlib
import ctypes
import importlib.resources
import threading
from collections.abc import Callable
from typing import Any

import moderngl

from .errors import GLError

_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swr", "software")

# The plain sonames first; the versioned ones are what runtime packages without -dev symlinks install.
_LIBRARIES: tuple[dict[str, str], ...] = ({}, {"libegl": "libEGL.so.1", "libgl": "libGL.so.1"})


class GLContext:
    """One headless OpenGL 4.3 context on EGL, shared by the GPU wave solver and the renderer.

    Use it as a context manager: entering makes the context current and returns the `moderngl.Context`; leaving
    restores the previous one and raises `GLError` if the driver recorded an error meanwhile.

    Parameters
    ----------
    device : int, optional
        EGL device index. By default the first device that yields a context.

    Raises
    ------
    GLError
        If no EGL device gives an OpenGL 4.3 core context.
    """

    def __init__(self, device: int | None = None) -> None:
        self._ctx = _create_context(device)
        info = self._ctx.info
        self.renderer: str = info["GL_RENDERER"]
        self.vendor: str = info["GL_VENDOR"]
        self.version: str = info["GL_VERSION"]
        self._depth = 0
        self._finish = _find_finish()

    @property
    def software(self) -> bool:
        """Whether the driver renders on the CPU. EGL falls back to that without saying so."""
        name = self.renderer.lower()
        return any(word in name for word in _SOFTWARE_RENDERERS)

    def __enter__(self) -> moderngl.Context:
        if self._depth == 0:
            self._ctx.__enter__()
        self._depth += 1
        return self._ctx

    def __exit__(self, *exc: object) -> None:
        self._depth -= 1
        error = self._ctx.error
        if self._depth == 0:
            self._ctx.__exit__(*exc)
        if error != "GL_NO_ERROR" and exc[0] is None:
            raise GLError(f"OpenGL reported {error} on {self.renderer}; see `ripple-sim info`")

    def wait(self) -> None:
        """Return when the driver has done all that it was told, and let other Python threads run meanwhile.

        moderngl holds the interpreter's lock while it waits, in `finish` as well as in reading back.
        """
        with self as ctx:
            if self._finish is None:
                ctx.finish()
            else:
                self._finish()

    def compute_shader(self, package: str, name: str, **defines: object) -> moderngl.ComputeShader:
        """Compile `shaders/{name}.glsl` of `package` as a compute shader with `#define`s put in."""
        source = load_shader(package, name, **defines)
        with self as ctx:
            return _compiled(name, lambda: ctx.compute_shader(source))

    def program(self, package: str, vertex: str, fragment: str, **defines: object) -> moderngl.Program:
        """Compile and link a vertex and a fragment shader from `shaders/` of `package`."""
        vertex_source = load_shader(package, vertex, **defines)
        fragment_source = load_shader(package, fragment, **defines)
        with self as ctx:
            return _compiled(
                f"{vertex} + {fragment}",
                lambda: ctx.program(vertex_shader=vertex_source, fragment_shader=fragment_source),
            )


def load_shader(package: str, name: str, **defines: object) -> str:
    """Read a GLSL file, resolve its `#include "file.glsl"` lines, and put the defines behind `#version`."""
    text = _read_shader(package, name)
    head, _, body = text.partition("\n")
    if not head.startswith("#version"):
        raise GLError(f"shader {package}/shaders/{name}.glsl must start with #version, found {head!r}")
    lines = "".join(f"#define {key} {value}\n" for key, value in defines.items())
    return f"{head}\n{lines}{body}"


def _read_shader(package: str, name: str) -> str:
    path = importlib.resources.files(package) / "shaders" / f"{name}.glsl"
    lines = []
    for line in path.read_text().splitlines():
        if line.startswith("#include"):
            lines.append(_read_shader(package, line.split('"')[1].removesuffix(".glsl")))
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


def _compiled(name: str, compile_shader: Callable[[], Any]) -> Any:
    try:
        return compile_shader()
    except moderngl.Error as error:
        raise GLError(f"shader {name} does not compile: {error}") from error


def _create_context(device: int | None) -> moderngl.Context:
    devices = range(8) if device is None else [device]
    reasons = []
    for libraries in _LIBRARIES:
        for index in devices:
            try:
                # moderngl's hints know nothing of the keywords that its backends take
                settings: dict[str, Any] = {"backend": "egl", "device_index": index, **libraries}
                return moderngl.create_context(require=430, standalone=True, **settings)
            except Exception as error:  # moderngl raises bare Exception here
                reasons.append(str(error))
                if "not loaded" in str(error):
                    break
    which = "any EGL device" if device is None else f"EGL device {device}"
    raise GLError(
        f"no OpenGL 4.3 context on {which} ({reasons[-1] if reasons else 'no device'}); "
        "install Mesa with: apt-get install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0"
    )


def _find_finish() -> Callable[[], None] | None:
    """OpenGL's glFinish as a function that does not hold the interpreter's lock; None if the library is not found."""
    for library in ("libGL.so.1", "libOpenGL.so.0"):
        with contextlib.suppress(OSError, AttributeError):
            finish = ctypes.CDLL(library).glFinish
            finish.restype = None
            return finish
    return None


_shared: dict[int | None, GLContext] = {}
_selected: int | None = None
_lock = threading.Lock()


def select_device(device: int | None) -> None:
    """Let `shared_context` mean this EGL device from now on; None: the first that yields a context."""
    global _selected
    with _lock:
        _selected = device


def shared_context(device: int | None = None) -> GLContext:
    """Return the process-wide context of a device (by default the selected one), created at the first call."""
    with _lock:
        device = _selected if device is None else device
        if device not in _shared:
            _shared[device] = GLContext(device)
        return _shared[device]
