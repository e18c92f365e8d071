"""EGL: the libraries, the devices, and the context that is current."""

from __future__ import annotations

import contextlib
import ctypes
import functools
from typing import Any

import moderngl

from ..errors import GLError

# The plain sonames first; the versioned ones are what runtime packages without -dev symlinks install.
_LIBRARIES: tuple[dict[str, str], ...] = ({}, {"libegl": "libEGL.so.1", "libgl": "libGL.so.1"})


def create_context(device: int | None) -> moderngl.Context:
    """Create a headless OpenGL 4.3 context on a device, or on the first that yields one; raises GLError."""
    devices = range(8) if device is None else [device]
    reasons = []
    for libraries in _LIBRARIES:
        for index in devices:
            try:
                # moderngl's hints lack the keywords of its backends
                settings: dict[str, Any] = {"backend": "egl", "device_index": index, **libraries}
                return moderngl.create_context(require=430, standalone=True, **settings)
            except Exception as error:  # moderngl raises bare Exception here
                reasons.append(str(error))
                if "not loaded" in str(error):
                    break
    reason = reasons[-1] if reasons else "no device"
    if device is not None:
        raise GLError(f"no OpenGL 4.3 context on EGL device {device} ({reason}); devices are counted from 0")
    raise GLError(
        f"no OpenGL 4.3 context on any EGL device ({reason}); "
        "install Mesa with: apt-get install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0"
    )


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
