"""The current OpenGL context of a thread: the program's own context comes back after ours.

OpenGL draws with the one context that is current in a thread, whichever window system made it: EGL,
GLX (windows on X11), or OSMesa (pictures in memory). Programs such as robosuite and Gymnasium make
their context current once and rely on it.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol, TypeAlias

from ..errors import GLError

Restore: TypeAlias = Callable[[], object]

# Names of the libraries that runtime packages install, and that moderngl loads. Another name could
# load another file, and hide that the library is damaged.
_EGL_LIBRARY = "libEGL.so.1"
_GLX_LIBRARY = "libGL.so.1"
_OSMESA_LIBRARIES = "libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6"

_EGL_DRAW = 0x3059  # EGL_DRAW: the surface that a context draws to
_EGL_READ = 0x305A  # EGL_READ: the surface that a context reads from
_OSMESA_TYPE = 0x23  # OSMESA_TYPE: the type of a picture's numbers

_pointer = ctypes.c_void_p


@functools.cache
def load_egl() -> ctypes.CDLL:
    """The EGL library, the same that moderngl loads."""
    try:
        egl = ctypes.CDLL(_EGL_LIBRARY)
    except OSError as error:
        raise GLError(
            f"the library {_EGL_LIBRARY} cannot be loaded ({error}); see `ripple-sim info`"
        ) from error
    egl.eglGetCurrentContext.restype = egl.eglGetCurrentDisplay.restype = _pointer
    egl.eglGetCurrentSurface.restype = egl.eglGetProcAddress.restype = _pointer
    egl.eglGetCurrentSurface.argtypes = [ctypes.c_int]
    egl.eglMakeCurrent.restype = egl.eglQueryAPI.restype = egl.eglBindAPI.restype = ctypes.c_uint
    egl.eglMakeCurrent.argtypes = [_pointer] * 4
    egl.eglBindAPI.argtypes = [ctypes.c_uint]
    return egl


@functools.cache
def egl_exists() -> bool:
    """Whether there is a library of EGL; macOS and Windows have none."""
    try:
        load_egl()
    except GLError:
        return False
    return True


class Current(Protocol):
    """A context of ours, and how it becomes current."""

    def make_current(self) -> bool:
        """Make the context current in this thread; return whether it is."""

    def is_current(self) -> bool:
        """Whether the context is current in this thread, as far as the platform tells."""

    def leave(self) -> None:
        """Leave this thread without this context, so that another thread may take it."""


class EGLCurrent(NamedTuple):
    """A context of EGL, its display, and the surfaces that it draws to and reads from, or 0."""

    display: int
    draw: int
    read: int
    context: int

    @classmethod
    def of_thread(cls) -> EGLCurrent | None:
        """The context that is current in this thread, or None."""
        egl = load_egl()
        context = egl.eglGetCurrentContext()
        if not context:
            return None
        return cls(
            display=egl.eglGetCurrentDisplay(),
            draw=egl.eglGetCurrentSurface(_EGL_DRAW) or 0,
            read=egl.eglGetCurrentSurface(_EGL_READ) or 0,
            context=context,
        )

    def make_current(self) -> bool:
        """Make the context current in this thread; return whether it is."""
        return bool(load_egl().eglMakeCurrent(*self)) and self.is_current()

    def is_current(self) -> bool:
        """Whether the context is current in this thread."""
        return current_context() == self.context

    def leave(self) -> None:
        """Leave this thread without a current EGL context."""
        release_current()


class GLXCurrent(NamedTuple):
    """A context of GLX, its display, and the drawables that it draws to and reads from."""

    display: int
    draw: int
    read: int
    context: int

    @classmethod
    def of_thread(cls) -> GLXCurrent | None:
        """The context that is current in this thread, or None."""
        glx = _load_glx()
        if glx is None:
            return None
        context = glx.glXGetCurrentContext()
        if not context:
            return None
        return cls(
            display=glx.glXGetCurrentDisplay(),
            draw=glx.glXGetCurrentDrawable(),
            read=glx.glXGetCurrentReadDrawable(),
            context=context,
        )

    def make_current(self) -> bool:
        """Make the context current in this thread; return whether it is."""
        glx = _load_glx()
        return glx is not None and bool(glx.glXMakeContextCurrent(*self)) and self.is_current()

    def is_current(self) -> bool:
        """Whether the context is current in this thread."""
        current = GLXCurrent.of_thread()
        return current is not None and current.context == self.context

    def leave(self) -> None:
        """Leave this thread without a current GLX context."""
        glx = _load_glx()
        if glx is not None:
            glx.glXMakeContextCurrent(self.display, 0, 0, None)


class PlatformCurrent:
    """A context of CGL or WGL, which moderngl makes current and leaves.

    Parameters
    ----------
    context : object
        Of the package glcontext. It makes the context that was current before current again.
    """

    def __init__(self, context: Any) -> None:
        self._context = context
        self._is_current = True  # as every new context

    def make_current(self) -> bool:
        """Make the context current in this thread; return whether it is."""
        self._context.__enter__()
        self._is_current = True
        return True

    def is_current(self) -> bool:
        """Whether the context is current, if only this object changes the current one."""
        return self._is_current

    def leave(self) -> None:
        """Make the context current that was current before."""
        self._context.__exit__()
        self._is_current = False


def current_context() -> int | None:
    """Handle of the EGL context that is current in this thread; None if there is none."""
    return load_egl().eglGetCurrentContext() if egl_exists() else None


def release_current() -> None:
    """Leave this thread without a current context of EGL or GLX: another thread may take it."""
    if egl_exists():
        egl = load_egl()
        egl.eglMakeCurrent(egl.eglGetCurrentDisplay(), None, None, None)
    window = GLXCurrent.of_thread()
    if window is not None:
        window.leave()


def leave_current() -> Restore:
    """Leave the context that is current in this thread, so that one of ours can be made current.

    The returned function makes the context current again instead of ours.
    """
    previous = EGLCurrent.of_thread() if egl_exists() else None
    if previous is None:
        return _leave_glx() or _leave_osmesa() or release_current

    def restore() -> None:
        if not previous.make_current():  # the program has destroyed it meanwhile
            release_current()

    return restore  # EGL itself replaces one context by another


def replace_current(ours: Current) -> Restore | None:
    """Make a context of ours current; None where it is lost.

    The returned function makes the context current again that was current before.
    """
    if isinstance(ours, PlatformCurrent):
        ours.make_current()
        return ours.leave
    restore = leave_current()
    if not ours.make_current():
        restore()
        return None
    return restore


@contextlib.contextmanager
def current_kept() -> Iterator[None]:
    """Make the context that is current when the block begins current again at the end."""
    api = load_egl().eglQueryAPI() if egl_exists() else None
    restore = leave_current()
    try:
        yield
    finally:
        restore()
        if api is not None:
            load_egl().eglBindAPI(api)  # a thread's next EGL contexts are of this kind


@functools.cache
def _load_glx() -> ctypes.CDLL | None:
    """The library of GLX, which moderngl loads, too; None if there is none."""
    try:
        glx = ctypes.CDLL(_GLX_LIBRARY)
        glx.glXGetCurrentContext.restype = _pointer
        glx.glXGetCurrentDisplay.restype = _pointer
        glx.glXGetCurrentDrawable.restype = ctypes.c_ulong
        glx.glXGetCurrentReadDrawable.restype = ctypes.c_ulong
        glx.glXMakeContextCurrent.argtypes = [_pointer, ctypes.c_ulong, ctypes.c_ulong, _pointer]
    except (OSError, AttributeError):
        return None
    return glx


def _leave_glx() -> Restore | None:
    """Leave a window's context; None if none is current."""
    previous = GLXCurrent.of_thread()
    if previous is None:
        return None
    previous.leave()

    def restore() -> None:
        release_current()
        previous.make_current()

    return restore


@functools.cache
def _load_osmesa() -> ctypes.CDLL | None:
    """The library of OSMesa that the program has loaded; None on Windows, which cannot tell."""
    if not hasattr(os, "RTLD_NOLOAD"):
        return None
    for name in _OSMESA_LIBRARIES:
        with contextlib.suppress(OSError):
            osmesa = ctypes.CDLL(name, mode=os.RTLD_NOLOAD | os.RTLD_NOW)
            osmesa.OSMesaGetCurrentContext.restype = _pointer
            osmesa.OSMesaGetColorBuffer.argtypes = [_pointer] * 5
            osmesa.OSMesaMakeCurrent.argtypes = [
                _pointer,
                _pointer,
                ctypes.c_uint,
                ctypes.c_int,
                ctypes.c_int,
            ]
            return osmesa
    return None


def _leave_osmesa() -> Restore | None:
    """Leave a context that draws into memory; None if none is current.

    Python programs have these from PyOpenGL.
    """
    osmesa = _load_osmesa() if "OpenGL.osmesa" in sys.modules else None
    if osmesa is None:
        return None
    context = osmesa.OSMesaGetCurrentContext()
    if not context:
        return None
    width = ctypes.c_int()
    height = ctypes.c_int()
    layout = ctypes.c_int()
    kind = ctypes.c_int()
    picture = _pointer()
    osmesa.OSMesaGetColorBuffer(context, *map(ctypes.byref, (width, height, layout, picture)))
    osmesa.OSMesaGetIntegerv(_OSMESA_TYPE, ctypes.byref(kind))
    osmesa.OSMesaMakeCurrent(None, None, 0, 0, 0)

    def restore() -> None:
        release_current()
        osmesa.OSMesaMakeCurrent(context, picture, kind.value, width.value, height.value)

    return restore
