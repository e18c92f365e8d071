"""Ripples in MuJoCo's own passive viewer. Needs a display; on macOS: mjpython.

python examples/passive_viewer.py
"""

import time

import mujoco

from ripple_sim import Material, Ripples, launch_passive

MODEL = """<mujoco>
  <visual><headlight ambient="0.3 0.3 0.3"/></visual>
  <worldbody>
    <light pos="1 -1 3" dir="-1 1 -3"/>
    <geom name="floor" type="plane" size="2 2 0.1" rgba="0.8 0.84 0.87 1"/>
    <body pos="0 0 0.3">
    <geom name="egg" type="ellipsoid" size="0.42 0.3 0.3" rgba="0.93 0.6 0.35 1"/></body>
    <body pos="0.08 -0.05 0.9"><freejoint/>
      <geom size="0.07" density="350" rgba="0.15 0.3 0.5 1" solref="0.005 0.3"/></body>
  </worldbody>
</mujoco>"""


def main() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    material = Material(speed=0.6, damping=1.5, stiffness=1500.0, viscosity=3e-4, density=300.0)
    ripples = Ripples(model, {"egg": material}, resolution=64)
    with launch_passive(model, data, ripples) as viewer:
        while viewer.is_running():
            start = time.perf_counter()
            ripples.mj_step(data, nstep=8)
            viewer.sync()
            time.sleep(max(0.0, 8 * model.opt.timestep - (time.perf_counter() - start)))


if __name__ == "__main__":
    main()
