"""Terminate the EGL display under a solver, and print the error of its next reading."""

import ctypes

from ripple_sim.solver import GLError, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import current, shared_context

waves = WaveSolver(sphere_atlas(1.0, 8), backend="gl")
library = current.load_egl()
for function in (library.eglGetCurrentDisplay, library.eglGetPlatformDisplay):
    function.restype = ctypes.c_void_p
with shared_context():
    display = ctypes.c_void_p(library.eglGetCurrentDisplay())
nothing = ctypes.c_void_p(None)
library.eglMakeCurrent(display, nothing, nothing, nothing)
library.eglTerminate(display)
try:
    print(waves.height)
except GLError as error:
    print(error)
