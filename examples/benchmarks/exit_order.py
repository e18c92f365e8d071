"""Our renderer, MuJoCo's and pyvista's in one process, in any order: no crash at exit.

    python examples/benchmarks/exit_order.py [ours mujoco pyvista]

A row for each order, without arguments for all orders of two and three; status 1 if a process did
not end with 0.
"""

import itertools
import os
import subprocess
import sys

MODEL = """<mujoco><worldbody><light pos='0 0 3'/><body pos='0 0 1'><freejoint/>
  <geom name='ball' type='sphere' size='0.3'/></body></worldbody></mujoco>"""

BEGIN = f"""
import gc, mujoco
model = mujoco.MjModel.from_xml_string({MODEL!r})
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
"""

USES = {
    "ours": """
from ripple_sim import Material, RippleError, RippleRenderer, Ripples
try:
    material = Material(speed=1.0, density=10.0)
    ripples = Ripples(model, {'ball': material}, resolution=8, backend='gl')
    ours = RippleRenderer(model, ripples, width=64, height=48)
    ours.render(data)
except RippleError as error:  # after a plotter
    print(error)
""",
    "mujoco": """
renderer = mujoco.Renderer(model, 48, 64)
renderer.update_scene(data)
renderer.render()
""",
    "pyvista": """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 48))
plotter.add_mesh(pyvista.Sphere())
plotter.screenshot(None)
""",
}

DROP = """
for name in ('ours', 'ripples', 'renderer', 'plotter'):
    globals().pop(name, None)
gc.collect()
"""


def end(order: tuple[str, ...], drop: bool) -> int:
    """Exit status of a process that uses these in this order."""
    program = BEGIN + "".join(USES[name] for name in order) + DROP * drop
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    result = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        env=environment,
        capture_output=True,
        check=False,
    )
    return result.returncode


def main() -> None:
    given = tuple(sys.argv[1:])
    orders = (
        [given]
        if given
        else [order for count in (2, 3) for order in itertools.permutations(USES, count)]
    )
    statuses = []
    print("| order | kept | dropped |\n| --- | --- | --- |")
    for order in orders:
        statuses += [end(order, drop) for drop in (False, True)]
        print(f"| {', '.join(order)} | {statuses[-2]} | {statuses[-1]} |", flush=True)
    sys.exit(any(statuses))


if __name__ == "__main__":
    main()
