"""Print the backend that 'auto' takes on hardware of OpenGL 4.1, then ask for backend 'gl'."""

from ripple_sim.solver import Material, WaveSolver, sphere_atlas
from ripple_sim.solver.gl import GLContext

GLContext.software = False
atlas = sphere_atlas(1.0, 8)
print(WaveSolver(atlas, Material(), backend="auto").backend)
WaveSolver(atlas, Material(), backend="gl")
