"""A robot's arm as in robot models: smooth covers to see, and capsules that collide.

    python examples/robot_arm.py

Makes out/robot_arm.png: balls fall on the arm while it lifts, and its covers ripple. A cover does
not collide, so it takes the contacts of its body's collision geoms; nothing has to be named.
"""

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from ripple_sim import Camera, Material, RippleRenderer, Ripples
from ripple_sim.scenes.shapes import Sdf, ellipsoid, polygonise, rounded_cone, smooth_union, sphere

MODEL = """<mujoco model="arm">
  <compiler angle="degree"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default>
    <joint axis="0 1 0" damping="4" armature="0.05"/>
    <position kp="400" kv="40"/>
    <geom solref="0.008 0.5" condim="4"/>
    <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2" mass="0"/>
    </default>
    <default class="collision"><geom type="capsule" group="3" density="400"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.88 0.89 0.91 1"/>
    <geom class="visual" type="cylinder" size="0.13 0.1" pos="0 0 0.1" rgba="0.25 0.27 0.3 1"/>
    <body name="upper" pos="0 0 0.26" euler="0 -20 0">
      <joint name="shoulder"/>
      <geom name="upper cover" class="visual" mesh="upper" rgba="0.92 0.93 0.95 1"/>
      <geom class="collision" size="0.085" fromto="0 0 0 0 0 0.45"/>
      <body name="lower" pos="0 0 0.45" euler="0 105 0">
        <joint name="elbow"/>
        <geom name="lower cover" class="visual" mesh="lower" rgba="0.95 0.55 0.2 1"/>
        <geom class="collision" size="0.09" fromto="0 0 0 0 0 0.16"/>
        <geom class="collision" size="0.075" fromto="0 0 0.16 0 0 0.44"/>
        <geom class="collision" type="sphere" size="0.1" pos="0 0 0.52"/>
      </body>
    </body>
    <body pos="0.19 0.01 0.87"><freejoint/>
    <geom name="blue" size="0.05" density="400" rgba="0.2 0.35 0.6 1"/></body>
    <body pos="0.36 -0.01 0.98"><freejoint/>
    <geom name="green" size="0.05" density="350" rgba="0.25 0.5 0.4 1"/></body>
  </worldbody>
  <actuator><position name="shoulder" joint="shoulder"/><position name="elbow" joint="elbow"/>
  </actuator>
</mujoco>"""
COVERS = {
    "upper": (
        rounded_cone((0, 0, 0), (0, 0, 0.45), 0.11, 0.085),
        ellipsoid((0, 0, 0.2), (0.1, 0.1, 0.17)),
        sphere((0, 0, 0.45), 0.1),
    ),
    "lower": (
        rounded_cone((0, 0, 0), (0, 0, 0.45), 0.095, 0.07),
        ellipsoid((-0.015, 0, 0.13), (0.105, 0.1, 0.14)),
        ellipsoid((0, 0, 0.52), (0.105, 0.09, 0.115)),
    ),
}
TIMES = (0.22, 0.26, 0.31)


def add_cover(spec: mujoco.MjSpec, name: str, solids: tuple[Sdf, ...]) -> None:
    V, F = polygonise(
        smooth_union(0.05, *solids), ((-0.16, -0.16, -0.16), (0.16, 0.16, 0.7)), 0.016
    )
    spec.add_mesh(name=name, uservert=V.ravel(), userface=F.ravel())


def main() -> None:
    spec = mujoco.MjSpec.from_string(MODEL)
    for name, solids in COVERS.items():
        add_cover(spec, name, solids)
    model = spec.compile()
    data = mujoco.MjData(model)
    skin = Material(speed=0.8, damping=1.5, stiffness=3000.0, viscosity=2e-4, density=220.0)
    ripples = Ripples(model, {"upper cover": skin, "lower cover": skin}, resolution=96)
    looks = {"upper cover": "rubber", "lower cover": "jelly"}
    renderer = RippleRenderer(model, ripples, width=480, height=400, looks=looks, lighting="studio")
    camera = Camera(lookat=(0.22, 0.0, 0.66), distance=0.95, azimuth=115.0, elevation=-38.0)

    frames = []
    given = dict.fromkeys(ripples, 0.0)
    while len(frames) < len(TIMES):
        data.ctrl[:] = -0.25 * data.time, -0.4 * data.time
        mujoco.mj_step(model, data)
        ripples.step(data)
        for hit in ripples.last_impulses:
            given[hit.geom] += hit.impulse
        if data.time > TIMES[len(frames)]:
            frames.append(renderer.render(data, camera))

    path = Path("out/robot_arm.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    for name, impulse in given.items():
        print(
            f"{name}: {impulse:.2f} N s, highest ripple "
            f"{1000 * np.abs(ripples[name].height).max():.1f} mm"
        )
    print(path)


if __name__ == "__main__":
    main()
