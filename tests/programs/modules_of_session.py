"""Run a session of the viewer in the browser; print which packages of windows it has loaded."""

import sys

from ripple_sim.viewer import page_server, page_view  # noqa: F401
from ripple_sim.viewer.opening import open_scene
from ripple_sim.viewer.session import Session

session = Session(open_scene("sphere"), resolution=8)
session.advance()
packages = {name.split(".")[0] for name in sys.modules}
print(sorted(packages & {"vtkmodules", "pyvista"}))
