"""Render a scene with the program, and lose the OpenGL context after 16 frames.

python render_until_context_is_lost.py software|hardware SCENE -o FRAMES; as on hardware, a frame
is on its way back when it happens.
"""

import ctypes
import sys
from typing import Any

from ripple_sim.cli import main as cli
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.video import render_video as module

LAST_FRAME = 16
OPTIONS = ["--size", "64x48", "--fps", "30", "--backend", "cpu", "--duration", "0.6"]

render = module.render_video


def lose_context(finished: int, frames: int) -> None:
    if finished == LAST_FRAME:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
        with shared_context():
            egl.eglTerminate(ctypes.c_void_p(egl.eglGetCurrentDisplay()))


def render_and_lose(*args: Any, **options: Any) -> Any:
    return render(*args, **{**options, "progress": lose_context})


driver, *words = sys.argv[1:]
if driver == "hardware":
    GLContext.software = False
module.render_video = render_and_lose
sys.exit(cli.main(["render", *words, *OPTIONS]))
