"""A new headless OpenGL context: on EGL, or of the platform's own window system without EGL.

EGL needs no display, and names the device. Without it, as on macOS and Windows, the context is
moderngl's own choice: CGL, WGL, or GLX on a display of X11.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import glcontext
import moderngl
import numpy as np

from ..errors import GLError
from .current import (
    Current,
    EGLCurrent,
    GLXCurrent,
    PlatformCurrent,
    current_kept,
    egl_exists,
    load_egl,
)

# Words in GL_RENDERER that name a driver which renders on the processor.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swr", "software", "lavapipe", "swiftshader")

# Names of the libraries that moderngl loads: its own names first, which packages with -dev symlinks
# install; then the names that runtime packages install.
_LIBRARIES: tuple[dict[str, str], ...] = ({}, {"libegl": "libEGL.so.1", "libgl": "libGL.so.1"})
_X11_LIBRARIES = {"libgl": "libGL.so.1", "libx11": "libX11.so.6"}

# Versions of OpenGL, times 100.
COMPUTE = 430  # compute shaders need it
RENDERING = 410  # rendering needs it
_REPORTED = 330  # a driver with this version is named in the error that asks for a later one

# Environment variable: the number of threads with which Mesa's llvmpipe draws; 0: none.
DRAWING_THREADS = "LP_NUM_THREADS"

# Environment variable of MuJoCo: number of the EGL device to draw on, where the program names none.
_MUJOCO_DEVICE = "MUJOCO_EGL_DEVICE_ID"

# EGL devices that are tried where nobody names one. A machine with more GPUs than this names one.
_TRIED_DEVICES = 8

_SHADER_CACHE_BYTES = 64e6  # room that Mesa's shader cache may need while a process runs

# The first picture: its left half is drawn red over blue.
_FIRST_PICTURE_SIZE = 8  # [pixels]
_FIRST_VERTEX_SHADER = """#version 330
void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);  // of a strip of two triangles
    gl_Position = vec4(corner.x - 1.0, 2.0 * corner.y - 1.0, 0.0, 1.0);
}"""
_FIRST_FRAGMENT_SHADER = """#version 330
out vec4 color;
void main() { color = vec4(1.0, 0.0, 0.0, 1.0); }"""


class Created(NamedTuple):
    """A new context, and what moderngl does not do with it."""

    ctx: moderngl.Context
    current: Current  # makes the context current, and leaves it
    address_of: Callable[[str], int]  # address of a function of OpenGL, by name
    info: dict[str, Any]  # of moderngl: names of the driver and its limits


def is_software(renderer: str) -> bool:
    """Whether a driver renders on the processor, by its GL_RENDERER."""
    return any(word in renderer.lower() for word in _SOFTWARE)


def create_context(device: int | None) -> Created:
    """Create a headless context: OpenGL 4.3, or else 4.1.

    The context that is current in this thread stays current.

    Parameters
    ----------
    device : int, optional
        EGL device index. By default the context is on the device that the environment variable
        MUJOCO_EGL_DEVICE_ID names, like MuJoCo's own renderer. Without the variable, it is on the
        first device that yields a context; without the library of EGL, it is the platform's own.

    Raises
    ------
    GLError
        If there is no such context, or what it draws is wrong.
    """
    _spare_full_disks()
    _draw_without_threads()
    with current_kept():
        if device is None and not egl_exists() and _has_display():
            return _create_on_platform()
        return _create_on_egl(device)


def _has_display() -> bool:
    """Whether the platform's own window system can make a context without EGL."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY"))


def _spare_full_disks() -> None:
    """Switch Mesa's shader cache off where its disk is nearly full, or its folder cannot be made.

    The cache is mapped into memory: a page without room on the disk kills the process. A folder
    that cannot be made makes Mesa complain on standard error.
    """
    names = ("MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
    folders = [os.environ[name] for name in names if os.environ.get(name)]
    folder = Path(folders[0] if folders else "/")
    with contextlib.suppress(OSError):
        existing = next(path for path in (folder, *folder.parents) if path.exists())
        is_full = shutil.disk_usage(existing).free < _SHADER_CACHE_BYTES
        if is_full or not os.access(existing, os.W_OK):
            os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")


def _draw_without_threads() -> None:
    """Have Mesa's llvmpipe draw in the calling thread, unless the user set the number of threads.

    llvmpipe reads the variable when its first context is made. One of its threads may unlock a
    fence that another thread has freed: this writes into the program's memory, and glibc ends the
    program ("corrupted unsorted chunks"). See docs/stability.md. Other drivers ignore the variable.
    """
    os.environ.setdefault(DRAWING_THREADS, "0")


def _create_on_egl(device: int | None) -> Created:
    """Create a context on an EGL device, and leave it current."""
    place = f"EGL device {device}"
    if device is None:
        device = _device_of_environment()
        place = f"EGL device {device}, which {_MUJOCO_DEVICE} names"
    if device is not None and device < 0:
        raise GLError(f"there is no {place}; devices are counted from 0")
    devices = range(_TRIED_DEVICES) if device is None else [device]
    reason = "no device"
    # a driver may give exactly the version that is asked for: the highest is asked for first
    for version in (COMPUTE, RENDERING, _REPORTED):
        for libraries in _LIBRARIES:
            for index in devices:
                # not in its hints
                settings: dict[str, Any] = {"backend": "egl", "device_index": index, **libraries}
                try:
                    ctx = moderngl.create_context(require=version, standalone=True, **settings)
                except Exception as error:  # moderngl raises bare Exception here
                    reason = str(error)
                    if "not loaded" in reason:
                        break
                    continue
                _require_version(ctx)
                return _on_egl(ctx)
    if device is not None:
        raise GLError(f"no OpenGL 4.1 context on {place} ({reason}); devices are counted from 0")
    advice = "install Mesa with: apt-get install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0"
    raise GLError(f"no OpenGL 4.1 context on any EGL device ({reason}); {advice}")


def _device_of_environment() -> int | None:
    """The device that the user has chosen for MuJoCo, or None."""
    text = os.environ.get(_MUJOCO_DEVICE)
    if text is None:
        return None
    try:
        return int(text)
    except ValueError:
        raise GLError(
            f"{_MUJOCO_DEVICE} must be the number of an EGL device, counted from 0, got {text!r}; "
            "unset it to take the first that works"
        ) from None


def _require_version(ctx: moderngl.Context) -> None:
    """Raise GLError where a context has OpenGL before 4.1."""
    if ctx.version_code < RENDERING:
        raise GLError(
            f"{ctx.info['GL_RENDERER']} has OpenGL {ctx.version_code / 100:.1f}; rendering needs "
            "4.1 or later, backend 'gl' 4.3: update the driver, or take Mesa's llvmpipe "
            "(LIBGL_ALWAYS_SOFTWARE=1); waves alone run with backend 'cpu'"
        )


def _on_egl(ctx: moderngl.Context) -> Created:
    """A new context of EGL, which is current."""
    current = EGLCurrent.of_thread()
    if current is None:
        raise GLError(
            "a new OpenGL context does not become current in this thread; see `ripple-sim info`"
        )
    find = load_egl().eglGetProcAddress
    return Created(ctx, current, lambda name: find(name.encode()), ctx.info)


def _create_on_platform() -> Created:
    """Create a context of the platform's own window system, and check it."""
    settings = _X11_LIBRARIES if sys.platform.startswith("linux") else {}
    reason = ""
    for version in (COMPUTE, RENDERING, _REPORTED):
        try:
            own = glcontext.default_backend()(mode="standalone", glversion=version, **settings)
            made = {"require": version, "standalone": True, "context": own}
            ctx = moderngl.create_context(**made)
        except Exception as error:  # both raise bare Exception here
            reason = str(error)
            continue
        _require_version(ctx)
        _check_first_picture(ctx)
        info = ctx.info
        current: Current = GLXCurrent.of_thread() or PlatformCurrent(own)
        current.leave()  # a new context is current
        return Created(ctx, current, own.load_opengl_function, info)
    raise GLError(
        f"no OpenGL 4.1 context, neither of EGL nor of the platform's window system ({reason}); "
        "waves alone run with backend 'cpu'"
    )


def _check_first_picture(ctx: moderngl.Context) -> None:
    """Draw a known picture; raise GLError if it comes out otherwise.

    On macOS and Windows nobody has tried this renderer: a driver that draws nothing is found here.
    """
    size = (_FIRST_PICTURE_SIZE, _FIRST_PICTURE_SIZE)
    picture = ctx.renderbuffer(size)
    framebuffer = ctx.framebuffer([picture])
    program = ctx.program(
        vertex_shader=_FIRST_VERTEX_SHADER, fragment_shader=_FIRST_FRAGMENT_SHADER
    )
    vertices = ctx.vertex_array(program, [])
    framebuffer.use()
    framebuffer.clear(0.0, 0.0, 1.0, 1.0)
    vertices.render(moderngl.TRIANGLE_STRIP, vertices=4)
    pixels = np.frombuffer(framebuffer.read(components=3), np.uint8).reshape(*size, 3)
    expected = np.zeros_like(pixels)
    expected[:, : _FIRST_PICTURE_SIZE // 2, 0] = 255
    expected[:, _FIRST_PICTURE_SIZE // 2 :, 2] = 255
    renderer = ctx.info["GL_RENDERER"]
    ctx.detect_framebuffer(0).use()  # a framebuffer that is deleted must not stay bound
    for made in (vertices, program, framebuffer, picture):
        made.release()
    if not np.array_equal(pixels, expected):
        raise GLError(
            f"{renderer} drew the first picture wrong; please report this, with what "
            "`ripple-sim info` prints; waves alone run with backend 'cpu'"
        )
