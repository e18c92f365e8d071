"""Make waves without the modules of POSIX, as on Windows, and then render a short video.

python run_without_posix.py VIDEO; prints which packages of figures and windows that has loaded.
"""

import sys

import mujoco

POSIX = ("fcntl", "grp", "resource")
MODEL = """<mujoco><worldbody><geom name="egg" size="0.3"/>
<body pos="0 0 0.36"><freejoint/><geom size="0.06"/></body></worldbody></mujoco>"""
OPTIONS = ["--size", "32x24", "--duration", "0.02", "--resolution", "8"]

sys.modules.update(dict.fromkeys(POSIX))  # None: an import fails
from ripple_sim import Material, Ripples  # noqa: E402

model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
ripples = Ripples(model, {"egg": Material()}, resolution=8, backend="cpu")
for _ in range(50):
    ripples.mj_step(data)
assert abs(ripples["egg"].height).max() > 0
for name in POSIX:
    del sys.modules[name]

from ripple_sim.cli.main import main  # noqa: E402

assert main(["render", "sphere", "-o", sys.argv[1], *OPTIONS]) == 0
print(sorted({"vtkmodules", "pyvista", "matplotlib"} & set(sys.modules)))
