"""Check EGL: exit with 0 if a device initialises and offers OpenGL.

Otherwise print what is missing and exit with 1.

Standard library only: it runs before anything else is installed.
"""

import ctypes
import sys

EGL_PLATFORM_DEVICE = 0x313F
EGL_OPENGL_API = 0x30A2
MAX_DEVICES = 16


def missing() -> str | None:
    """Name what keeps EGL from working, or None if it works."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        ctypes.CDLL("libGL.so.1")
    except OSError as error:
        return str(error)
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    addresses = [
        egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT")
    ]
    if not all(addresses):
        return "libEGL.so.1 does not list its devices"
    query_devices = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(ctypes.c_int)
    )(addresses[0])
    get_display = ctypes.CFUNCTYPE(
        ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p
    )(addresses[1])

    devices = (ctypes.c_void_p * MAX_DEVICES)()
    count = ctypes.c_int(0)
    query_devices(MAX_DEVICES, devices, ctypes.byref(count))
    for device in devices[: count.value]:
        display = ctypes.c_void_p(get_display(EGL_PLATFORM_DEVICE, device, None))
        if display and egl.eglInitialize(display, None, None) and egl.eglBindAPI(EGL_OPENGL_API):
            return None
    return f"none of {count.value} EGL devices initialises: no driver"


if __name__ == "__main__":
    reason = missing()
    if reason:
        print(reason)
    sys.exit(bool(reason))
