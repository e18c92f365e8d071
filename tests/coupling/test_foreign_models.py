"""Models as others write them (humanoids, arms, terrain) ripple with three added lines."""

import mujoco
import numpy as np
import pytest

from ripple_sim import Material, Ripples

HUMANOID = """
<mujoco model="humanoid">
  <compiler angle="degree" inertiafromgeom="true"/>
  <option timestep="0.003" solver="CG" iterations="50" cone="elliptic"/>
  <default>
    <joint damping="1" armature="0.01" limited="true"/>
    <geom type="capsule" density="500" condim="3" friction="0.8 0.05 0.05"/>
    <default class="thick"><geom size="0.06"/></default>
    <motor ctrlrange="-1 1" ctrllimited="true" gear="40"/>
  </default>
  <asset>
    <texture name="grid" type="2d" builtin="checker" width="32" height="32" rgb1="0.2 0.3 0.4" rgb2="0.3 0.4 0.5"/>
    <material name="grid" texture="grid"/>
    <hfield name="hills" nrow="6" ncol="6" size="3 3 0.15 0.2"
      elevation="0 0 0 0 0 0  0 1 1 1 0 0  0 1 2 1 0 0  0 1 1 1 1 0  0 0 0 1 0 0  0 0 0 0 0 0"/>
  </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="hfield" hfield="hills" material="grid" pos="0 0 -0.3"/>
    <body pos="0 0 1.1" childclass="thick">
      <freejoint/>
      <camera name="track" mode="trackcom" pos="0 -3 1"/>
      <geom name="chest" fromto="0 -0.1 0 0 0.1 0" size="0.12"/>
      <geom type="sphere" size="0.1" pos="0 0 0.25"/>
      <site name="spine" pos="0 0 -0.1"/>
      <body pos="0 0 -0.25">
        <joint name="abdomen" axis="0 1 0" range="-60 30"/>
        <geom name="pelvis" fromto="0 -0.08 0 0 0.08 0" size="0.1"/>
        <body pos="0 -0.1 -0.1"><joint name="right_hip" axis="0 1 0" range="-100 20"/>
          <geom fromto="0 0 0 0 0 -0.35"/>
          <body pos="0 0 -0.4"><joint name="right_knee" axis="0 -1 0" range="-150 0"/>
            <geom name="right_shin" fromto="0 0 0 0 0 -0.3"/></body></body>
        <body pos="0 0.1 -0.1"><joint name="left_hip" axis="0 1 0" range="-100 20"/>
          <geom fromto="0 0 0 0 0 -0.35"/>
          <body pos="0 0 -0.4"><joint name="left_knee" axis="0 -1 0" range="-150 0"/>
            <geom name="left_shin" fromto="0 0 0 0 0 -0.3"/></body></body>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="hips"><joint joint="right_hip" coef="1"/><joint joint="left_hip" coef="-1"/></fixed></tendon>
  <actuator>
    <motor joint="abdomen"/><motor joint="right_knee"/><motor joint="left_knee"/>
    <position tendon="hips" kp="10" ctrlrange="-1 1"/>
  </actuator>
  <sensor><accelerometer site="spine"/></sensor>
  <keyframe><key name="fallen" qpos="0 0 0.9 0.7 0 0.7 0 0.1 0 -0.3 0 -0.3"/></keyframe>
</mujoco>"""

ARM = """
<mujoco model="arm">
  <compiler angle="radian" autolimits="true"/>
  <option integrator="implicitfast" impratio="10" cone="elliptic"/>
  <size memory="8M"/>
  <default>
    <default class="visual"><geom contype="0" conaffinity="0" group="2" mass="0"/></default>
    <default class="link"><joint damping="2" armature="0.1"/><geom type="capsule" group="3"/></default>
  </default>
  <worldbody>
    <geom name="table" type="box" size="0.6 0.6 0.05" pos="0.4 0 -0.05"/>
    <body name="base" childclass="link">
      <geom type="cylinder" size="0.08 0.1" pos="0 0 0.1"/>
      <body name="upper" pos="0 0 0.25">
        <joint name="shoulder" axis="0 1 0" range="-1.5 2"/>
        <geom class="visual" type="box" size="0.05 0.05 0.2" pos="0 0 0.2" rgba="1 0.5 0 1"/>
        <geom fromto="0 0 0 0 0 0.35" size="0.04"/>
        <body name="forearm" pos="0 0 0.4">
          <joint name="elbow" axis="0 1 0" range="-0.2 2.6"/>
          <geom name="forearm" fromto="0 0 0.02 0 0 0.3" size="0.035"/>
          <body name="hand" pos="0 0 0.38">
            <joint name="left" type="slide" axis="0 1 0" range="0 0.04"/>
            <geom name="palm" type="box" size="0.03 0.06 0.02"/>
            <site name="grip" pos="0 0 0.03"/>
          </body>
        </body>
      </body>
    </body>
    <body name="crate" pos="0.62 0 0.06"><freejoint/>
      <geom name="crate" type="box" size="0.06 0.06 0.06" mass="0.4"/></body>
    <body name="lever" pos="0 0.6 0.2"><joint name="lever" axis="1 0 0"/><geom size="0.03"/></body>
    <site name="anchor" pos="0 0 0.6"/>
    <body name="ghost" mocap="true" pos="0.5 0.5 0.5"><geom class="visual" size="0.02"/></body>
  </worldbody>
  <contact><exclude body1="upper" body2="forearm"/></contact>
  <equality>
    <joint joint1="lever" joint2="elbow" polycoef="0 0.5 0 0 0"/>
  </equality>
  <tendon><spatial name="cable" width="0.004" stiffness="5" springlength="0 1"><site site="anchor"/><site site="grip"/>
  </spatial></tendon>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="80" kv="8"/>
    <general name="elbow" joint="elbow" gainprm="60" biastype="affine" biasprm="0 -60 -6"/>
    <velocity joint="left" kv="5"/>
  </actuator>
  <keyframe><key name="home" qpos="0.2 0.6 0 0.62 0 0.06 1 0 0 0 0.3" ctrl="0.2 0.6 0"/></keyframe>
</mujoco>"""


def run(xml: str, target: str, seconds: float, control: np.ndarray | None = None):
    """Anybody's loop, with three lines more: the import above, and the two that are marked."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    ripples = Ripples(model, {target: Material(speed=0.3, density=30.0)}, resolution=24, backend="cpu")  # (1)
    record = []
    while data.time < seconds:
        if control is not None:
            data.ctrl[:] = control
        mujoco.mj_step(model, data)
        ripples.step(data)  # (2)
        record.append((data.time, {hit.other: hit.impulse for hit in ripples.last_impulses}))
    assert not any(warning.number for warning in data.warning)
    return model, data, ripples, record


def plain(xml: str, seconds: float, control: np.ndarray | None = None) -> np.ndarray:
    """Positions that the same loop ends in without us."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    while data.time < seconds:
        if control is not None:
            data.ctrl[:] = control
        mujoco.mj_step(model, data)
    return data.qpos.copy()


def test_chest_of_a_humanoid_that_falls_on_hills_ripples() -> None:
    model, data, ripples, record = run(HUMANOID, "chest", 1.2)
    hits = {other for _, impulses in record for other in impulses}
    hills = "world/0"
    assert hills in hits
    weight = sum(model.body_mass) * 9.81
    given = sum(sum(impulses.values()) for _, impulses in record)
    assert 0.05 * weight < given < 10 * weight
    assert np.abs(ripples["chest"].height).max() > 1e-4
    np.testing.assert_array_equal(data.qpos, plain(HUMANOID, 1.2))


@pytest.mark.parametrize("target", ["palm", "crate"])
def test_link_of_an_arm_that_slaps_a_crate_ripples(target: str) -> None:
    control = np.array([1.1, 1.3, 0.0])
    _, data, ripples, record = run(ARM, target, 0.8, control)
    other = "crate" if target == "palm" else "palm"
    first = next(time for time, impulses in record if other in impulses)
    assert 0.02 < first < 0.7
    assert np.abs(ripples[target].height).max() > 1e-5
    np.testing.assert_array_equal(data.qpos, plain(ARM, 0.8, control))


def test_both_ends_of_a_hit_get_the_same() -> None:
    control = np.array([1.1, 1.3, 0.0])
    sums = {}
    for target, other in (("palm", "crate"), ("crate", "palm")):
        *_, record = run(ARM, target, 0.8, control)
        sums[target] = sum(impulses.get(other, 0.0) for _, impulses in record)
    assert sums["palm"] == pytest.approx(sums["crate"], rel=1e-12)
    assert sums["palm"] > 0
