"""A context of EGL that a program of its own keeps current, with surfaces, as a window's has."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator

from ripple_sim.solver.gl.current import EGLCurrent, load_egl

_NONE = 0x3038
_PLATFORM_DEVICE = 0x313F
_OPENGL_API = 0x30A2
_PBUFFER_OF_OPENGL = (ctypes.c_int * 5)(0x3033, 0x0001, 0x3040, 0x0008, _NONE)
_SIZE = (ctypes.c_int * 5)(0x3057, 8, 0x3056, 8, _NONE)

_pointer = ctypes.c_void_p


@contextlib.contextmanager
def own_context() -> Iterator[EGLCurrent]:
    """Make a second context current that draws to one surface and reads from another."""
    egl = load_egl()
    address = egl.eglGetProcAddress
    find_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, _pointer, _pointer)(
        address(b"eglQueryDevicesEXT")
    )
    find_display = ctypes.CFUNCTYPE(_pointer, ctypes.c_uint, _pointer, _pointer)(
        address(b"eglGetPlatformDisplayEXT")
    )
    create_surface = ctypes.CFUNCTYPE(_pointer, _pointer, _pointer, _pointer)(
        address(b"eglCreatePbufferSurface")
    )
    create_context = ctypes.CFUNCTYPE(_pointer, *[_pointer] * 4)(address(b"eglCreateContext"))
    device = _pointer()
    count = ctypes.c_int()
    find_devices(1, ctypes.byref(device), ctypes.byref(count))
    display = _pointer(find_display(_PLATFORM_DEVICE, device, None))
    assert egl.eglInitialize(display, None, None)
    config = _pointer()
    egl.eglChooseConfig(display, _PBUFFER_OF_OPENGL, ctypes.byref(config), 1, ctypes.byref(count))
    api = egl.eglQueryAPI()
    egl.eglBindAPI(_OPENGL_API)
    surfaces = [create_surface(display, config, _SIZE) for _ in range(2)]
    own = EGLCurrent(display.value or 0, *surfaces, create_context(display, config, None, None))
    egl.eglBindAPI(api)
    assert all(own) and own.make_current()
    try:
        yield own
    finally:
        egl.eglMakeCurrent(display, None, None, None)
        egl.eglDestroyContext(display, _pointer(own.context))
        for surface in surfaces:
            egl.eglDestroySurface(display, _pointer(surface))
