"""Make solvers in a fork of a process that has an OpenGL context; print backends and errors.

Prints three lines: of a new solver with backend 'gl', of one with 'auto', and of the height of
the solver that was made before the fork.
"""

import os
import sys

from ripple_sim.solver import GLError, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import context

waves = WaveSolver(sphere_atlas(1.0, 8), backend="gl")
context._lock.acquire()  # as if another thread made a context
if os.fork():
    os.wait()
    sys.exit(0)
for backend in ("gl", "auto"):
    try:
        print(WaveSolver(sphere_atlas(1.0, 8), backend=backend).backend, flush=True)
    except GLError as error:
        print(error, flush=True)
try:
    print(waves.height, flush=True)
except GLError as error:
    print(error, flush=True)
