"""Moving targets that fall on planes and height fields get what the ground gives them."""

import mujoco
import pytest
from mujoco_models import mesh_asset

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.scenes.shapes import peanut

MASS, DT = 2.0, 0.002
GROUND = {
    "plane": '<geom name="ground" type="plane" size="3 3 1"/>',
    "hfield": '<geom name="ground" type="hfield" hfield="flat"/>',
}
TARGETS = {
    "sphere": 'size="0.2"',
    "box": 'type="box" size="0.2 0.15 0.1"',
    "capsule": 'type="capsule" size="0.1 0.2" euler="0 90 0"',
    "ellipsoid": 'type="ellipsoid" size="0.3 0.2 0.1"',
    "cylinder": 'type="cylinder" size="0.2 0.1"',
    "seen": 'size="0.21" contype="0" conaffinity="0" mass="0"/><geom size="0.2"',
    **dict.fromkeys(("sdf", "flex", "convex", "hull"), 'type="mesh" mesh="peanut"'),
}


@pytest.mark.parametrize(
    ("target", "ground"),
    # MuJoCo finds no contacts of SDF geoms with height fields, which is warned of
    [(target, ground) for target in TARGETS for ground in GROUND if (target, ground) != ("sdf", "hfield")],
)
@pytest.mark.filterwarnings("ignore:geom 'target' collides as its convex hull", "ignore:the waves on geom")
def test_a_target_that_falls_on_the_ground_gets_its_change_of_momentum(target: str, ground: str) -> None:
    if target == "convex":
        pytest.importorskip("coacd")
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="{DT}"/><compiler angle="degree"/><default><geom condim="1"/></default>
        <asset>{mesh_asset("peanut", *peanut(0.06))}
        <hfield name="flat" nrow="5" ncol="5" size="3 3 0.1 0.2"/></asset><worldbody>{GROUND[ground]}
        <body name="body" pos="0.01 0.02 0.3"><freejoint/><geom name="target" {TARGETS[target]} mass="{MASS}"/></body>
        </worldbody></mujoco>"""
    )
    if target in ("sdf", "flex", "convex", "hull"):
        make_collidable(spec, "target", target)
    model = spec.compile()
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": Material(density=100)}, resolution=12, backend="cpu", conserve_volume=False)
    given = 0.0
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(each.impulse for each in ripples.last_impulses)
        assert all((each.geom, each.other) == ("target", "ground") for each in ripples.last_impulses)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    gained = MASS * (data.subtree_linvel[model.body("body").id, 2] + 9.81 * data.time)
    assert gained > 1.0
    assert given == pytest.approx(gained, rel=0.01)
