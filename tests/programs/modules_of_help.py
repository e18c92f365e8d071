"""Print the program's help, and then which heavy packages that has loaded."""

import sys

from ripple_sim.cli.main import main

HEAVY = {"vtkmodules", "pyvista", "numba", "mujoco", "moderngl", "av", "scipy"}

main(["--help"])
print(sorted(HEAVY & set(sys.modules)))
