"""Draw in an OpenGL context of this program, before, beside and after our context draws.

python draw_beside_ours.py memory (OSMesa) or window (GLFW). Prints the red of each picture, and
the OpenGL versions of both contexts.
"""

import sys
from typing import Any

import numpy as np
from OpenGL import GL

from ripple_sim.solver.gl import shared_context


def context_in_memory() -> Any:
    from OpenGL import osmesa
    from OpenGL.arrays import GLfloatArray

    context = osmesa.OSMesaCreateContextExt(osmesa.OSMESA_RGBA, 24, 8, 0, None)
    picture = GLfloatArray.zeros((4, 8, 4))
    assert osmesa.OSMesaMakeCurrent(context, picture, GL.GL_FLOAT, 8, 4)
    return context, picture


def context_of_a_window() -> Any:
    import glfw

    assert glfw.init()
    glfw.window_hint(glfw.VISIBLE, False)
    window = glfw.create_window(8, 4, "own", None, None)
    glfw.make_context_current(window)
    return window


def drawn_red(red: float) -> float:
    """Clear to a red in the current context, and read it back."""
    GL.glClearColor(red, 0, 0, 1)
    GL.glClear(GL.GL_COLOR_BUFFER_BIT)
    pixel = np.ravel(GL.glReadPixels(0, 0, 1, 1, GL.GL_RGBA, GL.GL_FLOAT))
    return round(float(pixel[0]), 1)


own = {"memory": context_in_memory, "window": context_of_a_window}[sys.argv[1]]()  # keeps it alive
print(drawn_red(0.2), GL.glGetString(GL.GL_VERSION).decode())
gl = shared_context()
print(drawn_red(0.4))
with gl as ctx:
    ours = ctx.simple_framebuffer((1, 1))
    ours.use()
    ours.clear(0.8)
    print(round(ours.read()[0] / 255, 1), ctx.info["GL_VERSION"])
print(drawn_red(0.6))
