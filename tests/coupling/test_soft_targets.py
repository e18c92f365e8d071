"""Flexes and skins as targets: their texels, their contacts, and the high-pass."""

import inspect

import mujoco
import numpy as np
import pytest
from hits import Run, contact_forces
from numpy.testing import assert_allclose

from ripple_sim import Ripples, Target
from ripple_sim.coupling import HighPass, SoftSurface, coarse_motions, target_of_flex
from ripple_sim.errors import SceneError
from ripple_sim.solver import Load, Material

SOFT = Material(speed=1.0, density=5.0, damping=2.0, stiffness=100.0)
HEAD = '<option timestep="0.001" solver="CG" tolerance="1e-8"/><size memory="20M"/>'
JELLY = f"""<mujoco>{HEAD}<worldbody>
<flexcomp name="jelly" type="grid" count="4 4 4" spacing=".1 .1 .1" pos="0 0 .2" dim="3"
  radius=".005" dof="trilinear"
 mass="5"><contact selfcollide="none"/><elasticity young="4e3" poisson=".3" damping=".02"/>
 </flexcomp>
<geom type="plane" size="3 3 .1" pos="0 0 .04"/>
<body name="ball" pos="0.03 0.02 .45"><freejoint/>
<geom name="ball" type="sphere" size=".06" mass=".4"/></body>
</worldbody></mujoco>"""
CLOTH = f"""<mujoco>{HEAD}<worldbody>
<flexcomp name="cloth" type="grid" count="6 6 1" spacing=".1 .1 .1" pos="0 0 1" dim="2"
  radius=".01" mass="1">
<contact selfcollide="none"/><edge equality="true" damping=".01"/>
<pin id="0 1 2 3 4 5 6 11 12 17 18 23 24 29 30 31 32 33 34 35"/></flexcomp>
<body name="ball" pos="0 0 1.2"><freejoint/><geom name="ball" type="sphere" size=".06" mass=".4"/>
</body>
</worldbody></mujoco>"""


def skinned() -> str:
    """A box of skin over two links, of which the second one turns."""
    x = np.linspace(-0.5, 0.5, 5)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    V = np.array([[each, 0.06 * y, 0.06 * z] for each in x for y, z in corners])
    F = [(0, 3, 2), (0, 2, 1), (16, 17, 18), (16, 18, 19)]
    for i in range(4):
        for j in range(4):
            a = 4 * i + j
            b = 4 * i + (j + 1) % 4
            F += [(a, b, b + 4), (a, b + 4, a + 4)]
    far = np.clip((V[:, 0] + 0.1) / 0.2, 0, 1)
    bones = ""
    for body, weights, at in (("near", 1 - far, "0 0 0"), ("far", far, "0 0 0")):
        which = np.flatnonzero(weights)
        bones += (
            f'<bone body="{body}" bindpos="{at}" bindquat="1 0 0 0" '
            f'vertid="{" ".join(map(str, which))}" '
            f'vertweight="{" ".join(f"{weight:g}" for weight in weights[which])}"/>'
        )
    return f"""<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody>
<body name="near"><geom name="upper" type="capsule" fromto="-.5 0 0 0 0 0" size=".05"/>
<body name="far"><joint name="elbow" type="hinge" axis="0 0 1" damping="1"/>
<geom name="lower" type="capsule" fromto="0 0 0 .5 0 0" size=".05" mass="2"/></body></body>
<body name="ball" pos="-.25 0 .3"><freejoint/><geom name="ball" type="sphere" size=".04" mass=".2"/>
</body>
</worldbody><deformable><skin name="arm" vertex="{" ".join(f"{each:g}" for each in V.ravel())}"
face="{" ".join(str(each) for triangle in F for each in triangle)}">{bones}</skin></deformable>
</mujoco>"""


def begun(xml: str, name: str) -> Run:
    model = mujoco.MjModel.from_xml_string(xml)
    return Run(model, name, material=SOFT, resolution=8, conserve_volume=True)


TARGETS = {"3d": (JELLY, "jelly"), "2d": (CLOTH, "cloth"), "skin": (skinned(), "arm")}


@pytest.mark.parametrize("xml, name", TARGETS.values(), ids=TARGETS)
def test_the_balls_momentum_reaches_the_surface(xml, name, recwarn):
    run = begun(xml, name).until(0.35)
    assert not any("wraps" in str(each.message) for each in recwarn)
    ball = run.model.body("ball")
    waves = run.ripples[name]
    gained = ball.mass[0] * (run.data.qvel[ball.dofadr[0] + 2] + 9.81 * run.data.time)
    assert gained > 0.2
    given = sum(hit.impulse for hits in run.hits for hit in hits if hit.other == "ball")
    assert given == pytest.approx(gained, rel=0.06)
    assert 1e-3 < np.abs(waves.height).max() < np.inf
    # the cloth is open, and the limb of the skin is long
    assert waves.atlas.layout == {"cloth": "patches", "arm": "patches"}.get(name, "cube")


def test_an_open_stiffness_suits_the_given_speed():
    model = mujoco.MjModel.from_xml_string(CLOTH)
    slow, fast = (Run(model, "cloth", material=Material(speed=c), resolution=8) for c in (0.4, 0.8))
    assert fast.ripples["cloth"].material.stiffness == pytest.approx(
        4 * slow.ripples["cloth"].material.stiffness
    )


HAMMOCK = f"""<mujoco>{HEAD}<worldbody>
<flexcomp name="cloth" type="grid" count="9 9 1" spacing=".05 .05 .05" pos="0 0 .5" dim="2"
  radius=".005" mass=".5">
<contact selfcollide="none"/><edge equality="true" damping=".01"/><pin id="0 8 72 80"/></flexcomp>
<body name="ball" pos=".01 .02 .655"><freejoint/>
<geom name="ball" type="sphere" size=".05" mass=".1"/></body>
</worldbody></mujoco>"""


def test_a_cloth_that_wraps_a_ball_is_pressed_by_more_than_it_loses(recwarn):
    """Forces on slopes cancel as vectors; the surface gets the sum of the normal forces."""
    run = begun(HAMMOCK, "cloth")
    model = run.model
    data = run.data
    amounts = 0.0
    whole = np.zeros(3)
    for _ in range(400):
        run.step()
        forces = contact_forces(model, data)
        on_ball = np.where(data.contact.geom[:, 1] >= 0, 1, -1)
        amounts += 0.001 * forces[:, 0].sum()
        whole += 0.001 * np.einsum(
            "k,ki,kij->j", on_ball, forces[:, :3], data.contact.frame.reshape(-1, 3, 3)
        )
    dof = model.body("ball").dofadr[0]
    gained = np.array([0.0, 0.0, 0.1 * 9.81 * data.time])
    assert_allclose(whole, 0.1 * data.qvel[dof : dof + 3] + gained, atol=1e-6)
    assert run.given() == pytest.approx(amounts, rel=1e-6)
    assert run.given() > 1.1 * np.linalg.norm(whole)
    told = [each for each in recwarn if "wraps" in str(each.message)]
    assert [str(each.message)[:32] for each in told] == ["flex 'cloth' wraps round 'ball':"]
    assert told[0].filename == inspect.getfile(Run), "the caller of step"


def test_texels_lie_where_the_flex_is():
    run = begun(JELLY, "jelly").until(0.1)
    corners = run.data.flexvert_xpos
    waves = run.ripples["jelly"]
    assert all(np.linalg.norm(corners - each, axis=1).min() < 1e-12 for each in waves.vertices)
    assert_allclose(waves.vertices[waves.atlas.mesh.F].min(axis=(0, 1)), corners.min(axis=0))


def test_a_skin_follows_its_bones():
    run = begun(skinned(), "arm").until(0.001)
    before = run.ripples["arm"].rest.mesh.V
    run.data.qpos[0] = np.pi / 2
    run.step()
    after = run.ripples["arm"].vertices
    near = before[:, 0] < -0.2
    far = before[:, 0] > 0.2
    assert_allclose(after[near], before[near], atol=1e-6)
    assert_allclose(after[far][:, 1], before[far][:, 0], atol=2e-3)


def test_unknown_soft_targets_and_unsupported_options_are_refused():
    model = mujoco.MjModel.from_xml_string(JELLY)
    with pytest.raises(SceneError, match="its flexes and skins are 'jelly'"):
        Ripples(model, {"jam": SOFT})
    with pytest.raises(SceneError, match="cannot push back: their waves have the masses"):
        Ripples(model, {"jelly": SOFT}, resolution=8, two_way=True)
    with pytest.raises(
        SceneError,
        match=r"^contacts names 'cloth', a flex or a skin, for which no geoms can be chosen",
    ):
        Ripples(
            mujoco.MjModel.from_xml_string(HAMMOCK),
            {"cloth": SOFT},
            contacts={"cloth": ["ball"]},
            resolution=8,
        )


def test_open_coefficients_are_chosen_by_the_model():
    model = mujoco.MjModel.from_xml_string(JELLY)
    waves = Ripples(model, {"jelly": Material()}, resolution=8)["jelly"]
    assert waves.material.density * waves.rest.areas.sum() == pytest.approx(5.0, rel=1e-2)
    assert waves.material.speed > 1


def test_contacts_follow_a_surface_that_is_moved_by_hand():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom name="target" type="sphere" size=".2"/>
        <body pos="0 0 .26"><freejoint/><geom name="ball" type="sphere" size=".05"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": SOFT}, resolution=8)
    for i in range(100):
        ripples["target"].move(ripples["target"].rest.mesh.V * [1, 1, 1 - 0.002 * i])
        ripples.mj_step(data)
    assert ripples.last_impulses[0].point[2] == pytest.approx(0.2 * (1 - 0.002 * 99), rel=0.01)
    ripples.change_material("target", damping=5.0)
    assert_allclose(ripples["target"].vertices, ripples["target"].atlas.mesh.V)


def flexed(dof: str) -> tuple[mujoco.MjModel, Ripples, SoftSurface]:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody>
        <flexcomp name="jelly" type="grid" count="3 3 3" spacing=".1 .1 .1" dim="3" dof="{dof}"
        radius=".005" mass="5"><contact selfcollide="none"/><elasticity young="4e3" poisson=".3"/>
        </flexcomp>
        </worldbody></mujoco>"""
    )
    ripples = Ripples(
        model, {"jelly": Target(Material(speed=1.0, density=5.0), high_pass=True)}, resolution=8
    )
    return model, ripples, SoftSurface(model, target_of_flex(model, 0))


@pytest.mark.parametrize("dof", ["full", "trilinear"])
def test_filtered_load_does_no_work_on_the_motions_of_the_flex(dof):
    _, ripples, surface = flexed(dof)
    waves = ripples["jelly"]
    texels = np.arange(40)
    load = Load(texels, np.linspace(1, 2, 40))
    fine = HighPass(waves, surface)(load)
    basis = coarse_motions(waves, surface)
    assert np.abs(basis.T @ fine.forces).max() < 1e-6 * np.abs(load.forces).sum()
    assert np.abs(fine.forces).max() > 0.1


def test_a_coarse_load_is_removed_completely():
    _, ripples, surface = flexed("trilinear")
    waves = ripples["jelly"]
    mass = waves.operator.mass.reshape(-1)
    motion = waves.rest.normals.reshape(-1, 3) @ [1.0, 2.0, 3.0]
    fine = HighPass(waves, surface)(Load(np.arange(len(mass)), mass * motion))
    assert np.abs(fine.forces).max() < 1e-6 * np.abs(mass * motion).max()
