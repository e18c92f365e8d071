"""Random scenes: targets of every kind, hung up in every way, hit by random bodies; the seed decides."""

import dataclasses

import mujoco
import numpy as np
import pytest
from mujoco_models import mesh_asset, vector

from ripple_sim import Material, Ripples
from ripple_sim.scenes.shapes import limbed, peanut

DT = 0.002
TARGETS = {
    "sdf": 'type="sdf" mesh="animal"',
    "saddle": 'type="sdf" mesh="peanut"',
    "hull": 'type="mesh" mesh="egg"',
    "sphere": 'type="sphere" size="0.3"',
    "ellipsoid": 'type="ellipsoid" size="0.35 0.25 0.2"',
    "capsule": 'type="capsule" size="0.2 0.15"',
    "cylinder": 'type="cylinder" size="0.25 0.12"',
    "box": 'type="box" size="0.3 0.2 0.1"',
}
MOUNTS = {
    "fixed": "",
    "mocap": "",
    "free": "<freejoint/>",
    "jointed": '<joint type="hinge" axis="0 0.6 0.8" pos="0.3 0 0"/>',
}
BODIES = (
    'type="sphere"',
    'type="box"',
    'type="capsule"',
    'type="ellipsoid"',
    'type="cylinder"',
    'type="mesh" mesh="egg"',
)
PROPORTIONS = ((1, 1, 1), (1, 0.8, 0.7), (0.7, 0.8, 0), (1.2, 0.9, 0.8), (1, 0.6, 0), ())
# contact springs of 200 rad/s that throw back with 0, a half and 0.9 of the speed
SOLREFS = ("0.02 1", "0.023 0.215", "0.149 0.0335")


@dataclasses.dataclass
class Given:
    """What one body and the target exchanged, by us and by MuJoCo."""

    impulse: float = 0.0
    change: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    force: float = 0.0
    push: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))


@pytest.fixture(scope="module")
def assets() -> str:
    V, F = peanut(0.06)
    egg = 0.3 * V / np.linalg.norm(V, axis=1, keepdims=True) * [1.0, 0.8, 0.7]
    meshes = {"animal": limbed(0.05), "peanut": (V, F), "egg": (egg, F), "small egg": (0.2 * egg, F)}
    return "".join(mesh_asset(name, *mesh) for name, mesh in meshes.items())


def scene(assets: str, rng: np.random.Generator, kind: str, mount: str) -> mujoco.MjModel:
    """A target in a random pose and three bodies on their way to it, which touch nothing but the target."""
    bodies = ""
    for i in range(3):
        shape = rng.integers(len(BODIES))
        size = vector(rng.uniform(0.04, 0.06) * np.array(PROPORTIONS[shape]))
        form = f'{BODIES[shape]} size="{size}"' if size else 'type="mesh" mesh="small egg"'
        way = rng.standard_normal(3)
        place = 0.9 * way / np.linalg.norm(way)
        bodies += f"""<body name="body {i}" pos="{vector(place)}" quat="{vector(rng.standard_normal(4))}"><freejoint/>
            <geom name="body {i}" {form} mass="{rng.uniform(0.1, 0.5):.4g}" contype="2" conaffinity="1"/></body>"""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{DT}" gravity="0 0 0" sdf_initpoints="10"/>
        <default><geom solref="{rng.choice(SOLREFS)}" condim="1"/></default><asset>{assets}</asset><worldbody>
        <body name="target" {'mocap="true"' if mount == "mocap" else ""} pos="{vector(rng.uniform(-0.1, 0.1, 3))}"
        quat="{vector(rng.standard_normal(4))}">{MOUNTS[mount]}<geom name="target" {TARGETS[kind]} mass="4"
        contype="1" conaffinity="2" pos="{vector(rng.uniform(-0.05, 0.05, 3))}"/></body>{bodies}</worldbody></mujoco>"""
    )


def contact_pushes(model: mujoco.MjModel, data: mujoco.MjData, target: int) -> dict[int, tuple[float, np.ndarray]]:
    """Sum of normal forces [N], and of their vectors, on each geom that touches the target."""
    pushes, wrench = {}, np.zeros(6)
    for i, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, i, wrench)
        first, second = contact.geom
        other, side = (second, 1.0) if first == target else (first, -1.0)
        force, push = pushes.get(other, (0.0, np.zeros(3)))
        pushes[other] = force + wrench[0], push + side * wrench[0] * contact.frame[:3]
    return pushes


# every kind with every mount, each with bodies, speeds and springs of its own
@pytest.mark.parametrize("seed", range(len(TARGETS) * len(MOUNTS)))
def test_random_hits_go_to_the_right_place_in_the_right_amount(assets: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    kind, mount = list(TARGETS)[seed % len(TARGETS)], list(MOUNTS)[seed // len(TARGETS)]
    model = scene(assets, rng, kind, mount)
    data, target = mujoco.MjData(model), model.geom("target").id
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=16, backend="cpu", conserve_volume=False)
    waves, given = ripples["target"], {}
    atlas = waves.atlas
    mujoco.mj_forward(model, data)
    names = [f"body {i}" for i in range(3)]
    addresses = {name: model.jnt_dofadr[model.body(name).jntadr[0]] for name in names}
    for name, start in addresses.items():
        aim = data.geom("target").xpos + rng.uniform(-0.08, 0.08, 3) - data.body(name).xpos
        data.qvel[start : start + 3] = rng.uniform(1.0, 3.0) * aim / np.linalg.norm(aim)
        data.qvel[start + 3 : start + 6] = rng.uniform(-3, 3, 3)
    drift = rng.uniform(-0.3, 0.3, 3)
    for _ in range(400):
        before = {name: data.qvel[start : start + 3].copy() for name, start in addresses.items()}
        if mount == "mocap":
            data.mocap_pos[0] += drift * DT
        mujoco.mj_step(model, data)
        ripples.step(data)
        position, rotation = data.geom("target").xpos, data.geom("target").xmat.reshape(3, 3)
        pushes = contact_pushes(model, data, target)
        for other, (force, push) in pushes.items():
            body = given.setdefault(model.geom(other).name, Given())
            body.force, body.push = body.force + force * DT, body.push + push * DT
        for name, start in addresses.items():
            if name in given:
                given[name].change += model.body(name).mass[0] * (data.qvel[start : start + 3] - before[name])
        for impulse in ripples.last_impulses:
            given[impulse.other].impulse += impulse.impulse
            assert impulse.geom == "target"
            # on the true surface, on the side from which the body comes
            local = (impulse.point - position) @ rotation
            closest, _ = atlas.project(local)
            assert np.linalg.norm(closest[0] - local) < 1e-9
            outward = rotation @ atlas.normals[impulse.texel]
            assert outward @ pushes[model.geom(impulse.other).id][1] > 0
        assert np.isfinite(waves.height).all()
    assert given, "nothing was hit"
    for body in given.values():
        assert body.impulse == pytest.approx(body.force, rel=1e-9)
        np.testing.assert_allclose(body.change, body.push, atol=0.03 * np.linalg.norm(body.push))
    total = sum(body.impulse for body in given.values())
    assert -waves.momentum() == pytest.approx(total, rel=0.03)
