"""Tries an installed ripple-sim: imports, command line, a rendered video, a MuJoCo loop."""

import importlib.resources
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path

start = time.perf_counter()
import ripple_sim  # noqa: E402

seconds = time.perf_counter() - start
heavy = {"vtkmodules", "pyvista", "numba", "mujoco", "moderngl"} & set(sys.modules)
if heavy:
    sys.exit(f"importing ripple_sim loads {', '.join(sorted(heavy))}")
files = importlib.resources.files("ripple_sim")
if not (files / "py.typed").is_file():
    sys.exit("py.typed is not installed")
if "site-packages" not in str(files):
    sys.exit(f"ripple_sim is not the installed one: {files}")

program = str(Path(sysconfig.get_path("scripts")) / "ripple-sim")
with tempfile.TemporaryDirectory() as folder:
    small = ["--size", "320x180", "--duration", "0.2", "--resolution", "32"]
    for arguments in (
        ["info"],
        [
            "atlas",
            str(files / "scenes" / "meshes" / "limbed.obj"),
            "--resolution",
            "32",
            "-o",
            f"{folder}/atlas.npz",
        ],
        ["render", "sphere", "-o", f"{folder}/sphere.mp4", *small],
    ):
        subprocess.run([program, *arguments], check=True, stdout=subprocess.DEVNULL)

import mujoco  # noqa: E402

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
  <geom name="egg" type="ellipsoid" size="0.4 0.3 0.3"/>
  <body pos="0.1 0 0.5"><freejoint/><geom size="0.06"/></body></worldbody></mujoco>""")
data = mujoco.MjData(model)
ripples = ripple_sim.Ripples(model, {"egg": ripple_sim.Material(speed=0.6)}, resolution=32)
impulse = 0.0
while data.time < 0.5:
    mujoco.mj_step(model, data)
    ripples.step(data)
    impulse += sum(hit.impulse for hit in ripples.last_impulses)
if not (impulse > 0 and abs(ripples["egg"].height).max() > 0):
    sys.exit("a ball fell on an egg, and nothing rippled")
print(
    f"ripple-sim {ripple_sim.__version__} works on Python {sys.version.split()[0]}, imported in "
    f"{seconds:.2f} s"
)
