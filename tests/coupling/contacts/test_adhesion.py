"""What sticks to a target presses with its weight on top of it, and pulls with its weight below it."""

import mujoco
import pytest

from ripple_sim import Material, Ripples

SECONDS, WEIGHT = 0.4, 9.81


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("sticky", ["geom", "actuator", "both"])
@pytest.mark.parametrize("side", [1, -1], ids=["above", "below"])
def test_a_sticky_ball_gives_the_target_its_weight_and_no_more(cone: str, sticky: str, side: int) -> None:
    adhesion = 'adhesion="20"' if sticky != "actuator" else ""
    actuator = '<adhesion body="ball" ctrlrange="0 1" gain="30"/>' if sticky != "geom" else ""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" cone="{cone}"/><worldbody><geom name="target" size="0.5"/>
        <body name="ball" pos="0 0 {side * 0.55}"><freejoint/>
        <geom name="ball" size="0.05" mass="1" gap="0.01" {adhesion}/></body></worldbody>
        <actuator>{actuator}</actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=8, backend="cpu", conserve_volume=False)
    given = 0.0
    while data.time < SECONDS - 1e-9:
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(impulse.impulse for impulse in ripples.last_impulses)
    assert abs(data.body("ball").xpos[2]) == pytest.approx(0.55, abs=2e-3), "the ball stays where it is"
    lost = (data.qvel[2] + WEIGHT * SECONDS) * model.body("ball").mass[0]
    assert given == pytest.approx(side * WEIGHT * SECONDS, rel=0.01)
    assert given == pytest.approx(side * abs(lost), rel=1e-3)
    # a share of the first moments may still be on its way
    assert ripples["target"].momentum() == pytest.approx(-given, rel=0.02)


def test_two_suckers_on_one_body_share_the_force_among_their_contacts() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001"/><worldbody><geom name="target" type="box" size="0.5 0.5 0.1"/>
        <body name="plate" pos="0 0 -0.15"><freejoint/><geom size="0.05" pos="-0.2 0 0" mass="1"/>
        <geom size="0.05" pos="0.2 0 0" mass="1"/></body></worldbody>
        <actuator><adhesion body="plate" ctrlrange="0 1" gain="60"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=8, backend="cpu", conserve_volume=False)
    for _ in range(200):
        mujoco.mj_step(model, data)
        ripples.step(data)
    left, right = (impulse.impulse for impulse in ripples.last_impulses)
    assert left == pytest.approx(-WEIGHT * 0.001, rel=0.01)
    assert right == pytest.approx(-WEIGHT * 0.001, rel=0.01)
