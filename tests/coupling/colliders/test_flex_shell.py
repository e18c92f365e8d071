"""Meshes that collide through a rigid flex: where it lies, what presses on it, and what is warned of."""

import warnings

import igl
import mujoco
import numpy as np
import pytest
import trimesh

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling.colliders.flex_shell import GAP_TOLERANCE, inset
from ripple_sim.coupling.model.target import shell_thickness, shells
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.render.visuals.unsupported import warn_of_unsupported
from ripple_sim.scenes.shapes import limbed, peanut
from ripple_sim.solver import Mesh

GEOM = mujoco.mjtGeom


def solid(extents: tuple[float, float, float], fineness: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(extents=extents)
    return trimesh.remesh.subdivide_to_size(box.vertices, box.faces, fineness)


def spec_of(
    shape: tuple[np.ndarray, np.ndarray], joint: str | None = None, route: str | None = "flex", **geom: object
) -> mujoco.MjSpec:
    """A mesh geom on a body of its own, which may move."""
    V, F = shape
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    body = spec.worldbody.add_body(name="base", pos=[0.1, -0.2, 0.3], quat=[0.8, 0.0, 0.6, 0.0])
    if joint == "free":
        body.add_freejoint()
    body.add_geom(name="target", type=GEOM.mjGEOM_MESH, meshname="shape", mass=3.0, **geom)
    if route is not None:
        make_collidable(spec, "target", route)
    return spec


def add_ball(spec: mujoco.MjSpec, name: str, pos: list[float], **geom: object) -> None:
    body = spec.worldbody.add_body(name=name, pos=pos)
    body.add_freejoint()
    body.add_geom(**{"name": name, "size": [0.04, 0, 0], "mass": 0.2, **geom})


@pytest.mark.parametrize("place", [{}, {"pos": [0.3, 0.1, 0.2], "quat": [0.5, 0.5, 0.1, 0.7]}])
def test_flex_lies_as_deep_inside_of_the_mesh_as_it_is_thick(place: dict[str, list[float]]) -> None:
    model = spec_of(peanut(0.04), **place).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    flex = shells(model)[model.geom("target").id]
    surface = data.geom("target").xpos + model.mesh_vert @ data.geom("target").xmat.reshape(3, 3).T
    depth = -igl.signed_distance(data.flexvert_xpos, surface, model.mesh_face.astype(np.int64))[0]
    size = np.ptp(model.mesh_vert, axis=0).max()
    thickness = shell_thickness(model, flex)
    assert 0.02 * size <= thickness <= 0.06 * size
    np.testing.assert_allclose(depth, thickness, atol=0.004 * size)


def test_inset_moves_the_planes_of_a_box_and_not_its_shape() -> None:
    extents = np.array([0.5, 0.4, 0.3])
    V, F = solid(tuple(extents), 0.1)
    moved = inset(Mesh.from_arrays(V, F), 0.03)
    np.testing.assert_allclose(np.ptp(moved, axis=0), extents - 0.06, atol=2e-4)
    inner = np.abs(moved) - (extents / 2 - 0.03)
    np.testing.assert_allclose(inner.max(axis=1), 0.0, atol=2e-4)


def test_sides_of_a_thin_part_do_not_change_places() -> None:
    V, F = solid((0.5, 0.4, 0.01), 0.05)
    mesh = Mesh.from_arrays(V, F)
    moved = inset(mesh, 0.03)
    for side in (-1, 1):
        assert (side * moved[side * mesh.V[:, 2] > 0.004, 2]).min() > 0


@pytest.mark.parametrize("shape", ["limbed", "box", "plate"])
def test_shell_is_as_thick_as_the_tolerance_allows(shape: str) -> None:
    V, F = {"limbed": limbed(0.04), "box": solid((0.5, 0.5, 0.5)), "plate": solid((0.5, 0.4, 0.01), 0.05)}[shape]
    model = spec_of((V, F)).compile()
    size = np.ptp(V, axis=0).max()
    thickness = shell_thickness(model, 0)
    # corners of a cube lose (sqrt(3) - 1) thicknesses; a plate that thin only gets thicker
    assert thickness / size == pytest.approx({"limbed": 0.05, "box": 0.02, "plate": 0.02}[shape])
    assert (np.sqrt(3) - 1) * 0.02 < GAP_TOLERANCE < (np.sqrt(3) - 1) * 0.03


def test_geom_keeps_its_mass_and_gives_its_contacts_to_the_flex() -> None:
    contact = {"contype": 2, "conaffinity": 5, "condim": 4, "priority": 1, "solref": [-900.0, -20.0], "solmix": 0.5}
    contact |= {"friction": [0.3, 0.02, 0.01], "solimp": [0.8, 0.9, 0.01, 0.4, 3.0], "margin": 0.001, "gap": 0.0}
    models = {route: spec_of(peanut(0.05), "free", route, **contact).compile() for route in ("sdf", "flex")}
    np.testing.assert_allclose(models["flex"].body_inertia, models["sdf"].body_inertia, rtol=1e-6)
    flex = models["flex"]
    assert not flex.geom("target").contype
    assert not flex.geom("target").conaffinity
    for name in set(contact) - {"margin"}:
        np.testing.assert_allclose(getattr(flex, f"flex_{name}")[0], contact[name])
    assert shell_thickness(flex, 0) == pytest.approx(0.001 + 0.05 * np.ptp(flex.mesh_vert, axis=0).max())


def test_another_route_leaves_no_flex_behind() -> None:
    spec = spec_of(peanut(0.05), contype=2, conaffinity=5)
    make_collidable(spec, "target", "flex")
    assert spec.compile().nflex == 1
    make_collidable(spec, "target", "sdf")
    model = spec.compile()
    assert model.nflex == 0
    assert (model.geom("target").contype, model.geom("target").conaffinity) == (2, 5)
    assert model.geom("target").type == GEOM.mjGEOM_SDF


def test_bodies_and_worlds_without_a_name_will_do() -> None:
    V, F = peanut(0.06)
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    for parent, name in ((spec.worldbody, "a"), (spec.worldbody.add_body(pos=[0, 0, 1]), "b")):
        parent.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname="shape")
        make_collidable(spec, name, "flex")
    model = spec.compile()
    assert shells(model) == {model.geom("a").id: 0, model.geom("b").id: 1}


def test_flex_that_cannot_be_made_is_refused() -> None:
    spec = spec_of(peanut(0.06), route=None)
    spec.compiler.discardvisual = True
    with pytest.raises(SceneError, match="discardvisual = False"):
        make_collidable(spec, "target", "flex")
    spec = spec_of(peanut(0.06), route=None)
    spec.worldbody.add_geom(name="lost", type=GEOM.mjGEOM_MESH, meshname="nothing")
    with pytest.raises(SceneError, match=r"does not compile: .*nothing"):
        make_collidable(spec, "target", "flex")


def test_flex_of_another_name_body_or_kind_stands_for_nothing() -> None:
    V, F = peanut(0.06)
    mesh = {"vert": V.ravel(), "elem": F.ravel()}
    spec = spec_of((V, F), route=None)
    spec.worldbody.add_body(name="elsewhere")
    spec.add_flex(name="other", dim=2, vertbody=["base"], **mesh)
    assert shells(spec.compile()) == {}
    for body, geom in (("base", {0: 1}), ("elsewhere", {})):
        changed = spec.copy()
        changed.add_flex(name="target", dim=2, vertbody=[body], **mesh)
        assert shells(changed.compile()) == geom


def run(spec: mujoco.MjSpec, targets: list[str], seconds: float) -> tuple[Ripples, list, mujoco.MjData]:
    model = spec.compile()
    data = mujoco.MjData(model)
    material = {name: Material(density=50) for name in targets}
    ripples, impulses = Ripples(model, material, resolution=12, backend="cpu", conserve_volume=False), []
    while data.time < seconds:
        mujoco.mj_step(model, data)
        ripples.step(data)
        impulses += ripples.last_impulses
    return ripples, impulses, data


ROUND = {
    "sphere": {"size": [0.05, 0, 0]},
    "capsule": {"type": GEOM.mjGEOM_CAPSULE, "size": [0.03, 0.05, 0]},
    "ellipsoid": {"type": GEOM.mjGEOM_ELLIPSOID, "size": [0.07, 0.06, 0.04]},
    "cylinder": {"type": GEOM.mjGEOM_CYLINDER, "size": [0.05, 0.03, 0]},
    "mesh": {"type": GEOM.mjGEOM_MESH, "meshname": "pebble"},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("body", ROUND)
def test_bodies_in_any_pose_give_what_they_lose_on_their_side(body: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = spec_of(limbed(0.04), "free" if seed % 2 else None, condim=1)
    V, F = peanut(0.06)
    pebble = 0.05 * V / np.linalg.norm(V, axis=1, keepdims=True)
    spec.add_mesh(name="pebble", uservert=pebble.ravel(), userface=F.ravel())
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "body", [0, 0, 9], condim=1, **ROUND[body])
    model = spec.compile()
    data, joint = mujoco.MjData(model), model.joint(model.body("body").jntadr[0])
    mujoco.mj_forward(model, data)
    way, place, start = rng.standard_normal(3), joint.qposadr[0], joint.dofadr[0]
    way /= np.linalg.norm(way)
    data.qpos[place : place + 7] = [*(data.geom("target").xpos + 0.6 * way), *rng.standard_normal(4)]
    data.qvel[start : start + 6] = [*(-2 * way + rng.uniform(-0.1, 0.1, 3)), *rng.uniform(-3, 3, 3)]
    ripples = Ripples(model, {"target": Material(density=50)}, resolution=12, backend="cpu", conserve_volume=False)
    atlas, given, lost = ripples["target"].atlas, 0.0, 0.0
    while data.time < 0.5:
        before = data.qvel[start : start + 3].copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        change = 0.2 * (data.qvel[start : start + 3] - before)
        lost += float(np.linalg.norm(change))
        for impulse in ripples.last_impulses:
            given += impulse.impulse
            assert data.geom("target").xmat.reshape(3, 3) @ atlas.normals[impulse.texel] @ change > 0
    assert given > 0.1
    assert given == pytest.approx(lost, rel=0.03)
    assert -ripples["target"].momentum() == pytest.approx(given, rel=0.03)


def test_impulses_lie_where_the_balls_are_nearest_to_the_true_surface() -> None:
    spec = spec_of(peanut(0.03))
    spec.option.gravity = [0, 0, 0]
    rng = np.random.default_rng(0)
    # one side collides with the other alone: the balls pass through each other
    spec.flex("target").contype, spec.flex("target").conaffinity = 2, 0
    directions = rng.standard_normal((30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for i, direction in enumerate(directions):
        start = np.array([0.1, -0.2, 0.3]) + 0.5 * direction + rng.uniform(-0.03, 0.03, 3)
        add_ball(spec, f"ball {i}", start.tolist(), size=[0.02, 0, 0], contype=0, conaffinity=2, solref=[0.01, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel.reshape(-1, 6)[:, :3] = -directions
    ripples = Ripples(model, {"target": Material()}, resolution=48, backend="cpu")
    atlas, off, hit = ripples["target"].atlas, [], set()
    while data.time < 0.6:
        mujoco.mj_step(model, data)
        ripples.step(data)
        position, rotation = data.geom("target").xpos, data.geom("target").xmat.reshape(3, 3)
        for impulse in ripples.last_impulses:
            nearest, _ = atlas.project((data.geom(impulse.other).xpos - position) @ rotation)
            off.append(np.linalg.norm((impulse.point - position) @ rotation - nearest))
            hit.add(impulse.other)
    assert len(hit) == len(directions)
    texel = np.sqrt(atlas.areas.mean())
    assert np.median(off) < 0.3 * texel
    assert np.quantile(off, 0.99) < texel


def test_two_targets_with_flexes_ripple_with_one_momentum() -> None:
    V, F = peanut(0.05)
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    for name, height in (("lower", 0.0), ("upper", 0.45)):
        body = spec.worldbody.add_body(name=name, pos=[0.01, 0.02, height])
        joint = body.add_freejoint()
        joint.name = name
        body.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname="shape", mass=2.0)
        make_collidable(spec, name, "flex")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("upper").qvel[2] = -1.5
    ripples = Ripples(
        model, {"lower": Material(), "upper": Material()}, resolution=12, backend="cpu", conserve_volume=False
    )
    given = {"lower": 0.0, "upper": 0.0}
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        ripples.step(data)
        for impulse in ripples.last_impulses:
            given[impulse.geom] += impulse.impulse
            assert {impulse.geom, impulse.other} == {"lower", "upper"}
    lost = 2.0 * np.linalg.norm(data.joint("upper").qvel[:3] - [0, 0, -1.5])
    assert given["lower"] == pytest.approx(lost, rel=0.03)
    assert given["upper"] == pytest.approx(lost, rel=0.03)


def test_flex_of_a_geom_that_does_not_ripple_presses_under_the_geoms_name() -> None:
    spec = mujoco.MjSpec()
    V, F = peanut(0.05)
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    spec.default.geom.condim = 1
    spec.worldbody.add_geom(name="ball", size=[0.3, 0, 0])
    body = spec.worldbody.add_body(name="animal", pos=[0, 0, 0.7])
    body.add_freejoint()
    body.add_geom(name="animal", type=GEOM.mjGEOM_MESH, meshname="shape", mass=0.5)
    make_collidable(spec, "animal", "flex")
    _, impulses, data = run(spec, ["ball"], 0.4)
    assert {(impulse.geom, impulse.other) for impulse in impulses} == {("ball", "animal")}
    lost = 0.5 * (data.body("animal").cvel[5] + 9.81 * data.time)
    assert sum(impulse.impulse for impulse in impulses) == pytest.approx(lost, rel=0.1)


def test_flex_written_by_hand_is_known_by_its_name() -> None:
    V, F = peanut(0.05)
    points, triangles = " ".join(f"{x:.5g}" for x in V.ravel()), " ".join(map(str, F.ravel()))
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><asset><mesh name="shape" vertex="{points}" face="{triangles}"/></asset><worldbody>
        <geom name="target" type="mesh" mesh="shape" contype="0" conaffinity="0"/>
        <flexcomp name="target" type="direct" dim="2" rigid="true" radius="0.004" point="{points}"
        element="{triangles}"/></worldbody></mujoco>"""
    )
    add_ball(spec, "ball", [-0.17, 0.01, 0.35])
    ripples, impulses, data = run(spec, ["target"], 0.25)
    assert {(impulse.geom, impulse.other) for impulse in impulses} == {("target", "ball")}
    lost = 0.2 * np.linalg.norm(data.body("ball").cvel[3:] + np.array([0, 0, 9.81]) * data.time)
    assert sum(impulse.impulse for impulse in impulses) == pytest.approx(lost, rel=0.03)
    assert -ripples["target"].momentum() == pytest.approx(lost, rel=0.05)


def test_flexes_that_stand_for_geoms_are_not_missed_in_the_picture() -> None:
    spec = spec_of(peanut(0.06))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_unsupported(spec.compile())
    V, F = peanut(0.06)
    spec.add_flex(name="other", dim=2, vertbody=["base"], vert=V.ravel(), elem=F.ravel())
    with pytest.warns(RippleWarning, match="has 1 flexes"):
        warn_of_unsupported(spec.compile())


def test_what_a_flex_meets_badly_is_warned_of_by_name() -> None:
    spec = spec_of(peanut(0.06), "free")
    base = spec.body("base")
    arm = base.add_body(name="arm", pos=[0, 0, 0.5])
    arm.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)
    arm.add_geom(name="arm", size=[0.05, 0, 0], mass=0.1)
    base.add_body(name="horn", pos=[0, 0, 0.4]).add_geom(name="horn", size=[0.05, 0, 0], mass=0.1)
    add_ball(spec, "excluded", [0, 0, 2])
    spec.add_exclude(bodyname1="excluded", bodyname2="base")
    add_ball(spec, "ball", [0, 0, 3])
    add_ball(spec, "pebble", [0, 0, 4], type=GEOM.mjGEOM_SDF, meshname="shape")
    add_ball(spec, "crate", [0, 0, 5], type=GEOM.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    with pytest.warns(RippleWarning) as caught:
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
    [message] = [str(warning.message) for warning in caught]
    assert "'target' collides through a flex" in message
    assert "with box-shaped meshes ('crate')" in message
    assert "pushed out ('pebble')" in message
    assert "excluded ('arm', 'excluded')" in message
    for geom in ("crate", "pebble", "arm", "excluded"):
        spec.geom(geom).contype = spec.geom(geom).conaffinity = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
