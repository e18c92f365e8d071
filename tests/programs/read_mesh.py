"""Read a mesh file, and ignore the error if there is one: python read_mesh.py FILE."""

import contextlib
import sys

from ripple_sim.solver import MeshError, load_mesh

with contextlib.suppress(MeshError):
    load_mesh(sys.argv[1])
