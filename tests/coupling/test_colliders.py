"""The routes of `make_collidable`: where flex colliders lie, and sheets of open meshes."""

import igl
import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import add_ball, forwarded, mesh_spec
from vessels import opened

from ripple_sim import drop_scene, make_collidable
from ripple_sim.coupling import find_flex_colliders, flex_thickness, inset
from ripple_sim.errors import SceneError
from ripple_sim.scenes.shapes import limbed, peanut, polygonise, sphere
from ripple_sim.solver import Mesh


def spec_of(V: np.ndarray, F: np.ndarray) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="shape")
    spec.worldbody.add_geom(name="knob", size=[0.01, 0, 0], pos=[0, 0, 9])
    return spec


def test_a_body_lands_on_the_surface_that_the_collider_promises() -> None:
    # the waist of the peanut, 0.045 m below its hull
    V, F = peanut(0.04)
    waist = V[np.abs(V[:, 0]) < 0.03][:, 2].max()
    heights = {}
    for route in ("sdf", "flex", "hull"):
        spec = spec_of(V, F)
        make_collidable(spec, "target", route)
        add_ball(spec, "ball", [0, 0, 0.35], size=[0.02, 0, 0])
        data = mujoco.MjData(model := spec.compile())
        while data.time < 2 and not any(
            contact.dist < contact.includemargin for contact in data.contact
        ):
            mujoco.mj_step(model, data)
        heights[route] = data.body("ball").xpos[2] - 0.02
    assert heights == pytest.approx({"sdf": waist, "flex": waist, "hull": V[:, 2].max()}, abs=0.012)
    assert heights["hull"] - heights["sdf"] > 0.03


@pytest.mark.parametrize(("solref", "restitution"), [([0.02, 1.0], 0.13), ([-40000.0, -90.0], 0.5)])
def test_routes_agree_where_the_hull_is_the_surface(
    solref: list[float], restitution: float
) -> None:
    V, F = peanut(0.05)
    for route in ("sdf", "flex", "hull"):
        spec = spec_of(0.3 * V / np.linalg.norm(V, axis=1, keepdims=True), F)
        spec.option.gravity = [0, 0, 0]
        spec.geom("target").solref = solref
        make_collidable(spec, "target", route)
        add_ball(spec, "ball", [0.001, 0.002, 0.4], mass=0.1, solref=solref, condim=1)
        run = Run(spec, "target", resolution=8, conserve_volume=True)
        run.data.qvel[2] = -1.5
        given = run.until(0.3).given()
        assert given == pytest.approx(
            0.1 * np.linalg.norm(run.data.qvel[:3] - [0, 0, -1.5]), rel=0.03
        )
        assert run.data.qvel[2] / 1.5 == pytest.approx(restitution, abs=0.1)


@pytest.mark.parametrize("route", ["auto", "flex", "convex"])
@pytest.mark.parametrize("earlier", ["flex", "hull"])
def test_the_earlier_collider_stays_if_a_new_one_fails(earlier: str, route: str) -> None:
    V, F = peanut(0.1)
    spec = mesh_spec((V, F[:-40]), route=earlier)  # open: it has no convex parts
    if route != "convex":
        spec.worldbody.add_geom(name="broken", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="none")
    geom = spec.geom("target")

    def state() -> tuple[int, ...]:
        return (
            geom.type,
            geom.contype,
            geom.conaffinity,
            spec.option.enableflags,
            len(spec.flexes),
            len(spec.geoms),
        )

    before = state()
    with pytest.raises(SceneError):
        make_collidable(spec, "target", route)
    assert state() == before


def test_primitives_are_left_alone() -> None:
    spec = spec_of(*peanut(0.05))
    assert make_collidable(spec, "knob").type == mujoco.mjtGeom.mjGEOM_SPHERE


@pytest.mark.parametrize(
    ("geom", "route", "message"),
    [
        ("nose", "sdf", "geoms are 'target', 'knob'"),
        ("target", "ghost", "must be one of 'auto', 'sdf', 'flex', 'convex', 'hull'"),
    ],
)
def test_unknown_names_are_refused(geom: str, route: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make_collidable(spec_of(*peanut(0.05)), geom, route)


@pytest.mark.parametrize(
    ("mesh", "before", "points"), [(False, None, 10), (False, 6, 6), (True, None, 50)]
)
def test_starting_points_are_never_raised_and_mujoco_has_room_for_their_contacts(
    mesh, before, points
) -> None:
    spec = mesh_spec(limbed(0.1), route=None)
    spec.option.sdf_initpoints = before or spec.option.sdf_initpoints
    body = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "shape"} if mesh else {}
    add_ball(spec, "other", [0, 0, 2], **body)
    make_collidable(spec, "target", "sdf")
    assert spec.option.sdf_initpoints == points


GEOM = mujoco.mjtGeom


def solid(
    extents: tuple[float, float, float], fineness: float = 2.0
) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(extents=extents)
    return trimesh.remesh.subdivide_to_size(box.vertices, box.faces, fineness)


@pytest.mark.parametrize("place", [{}, {"pos": [0.3, 0.1, 0.2], "quat": [0.5, 0.5, 0.1, 0.7]}])
def test_a_flex_collider_lies_one_thickness_inside_the_mesh(place: dict[str, list[float]]) -> None:
    model = mesh_spec(peanut(0.04), **place).compile()
    data = forwarded(model)
    flex = find_flex_colliders(model)[model.geom("target").id]
    surface = data.geom("target").xpos + model.mesh_vert @ data.geom("target").xmat.reshape(3, 3).T
    depth = -igl.signed_distance(data.flexvert_xpos, surface, model.mesh_face.astype(np.int64))[0]
    size = np.ptp(model.mesh_vert, axis=0).max()
    thickness = flex_thickness(model, flex)
    assert 0.02 * size <= thickness <= 0.06 * size
    np.testing.assert_allclose(depth, thickness, atol=0.004 * size)


def test_inset_moves_the_planes_of_a_box_and_not_its_shape() -> None:
    extents = np.array([0.5, 0.4, 0.3])
    V, F = solid(tuple(extents), 0.1)
    moved = inset(Mesh.from_arrays(V, F), 0.03)
    np.testing.assert_allclose(np.ptp(moved, axis=0), extents - 0.06, atol=2e-4)
    inner = np.abs(moved) - (extents / 2 - 0.03)
    np.testing.assert_allclose(inner.max(axis=1), 0.0, atol=2e-4)


def test_inset_sides_of_a_thin_part_do_not_cross() -> None:
    V, F = solid((0.5, 0.4, 0.01), 0.05)
    mesh = Mesh.from_arrays(V, F)
    moved = inset(mesh, 0.03)
    for side in (-1, 1):
        assert (side * moved[side * mesh.V[:, 2] > 0.004, 2]).min() > 0


def test_geom_keeps_its_mass_and_gives_its_contacts_to_the_flex() -> None:
    contact = {
        "contype": 2,
        "conaffinity": 5,
        "condim": 4,
        "priority": 1,
        "solref": [-900.0, -20.0],
        "solmix": 0.5,
    }
    contact |= {
        "friction": [0.3, 0.02, 0.01],
        "solimp": [0.8, 0.9, 0.01, 0.4, 3.0],
        "margin": 0.001,
        "gap": 0.0,
    }
    models = {
        route: mesh_spec(peanut(0.05), "free", route, **contact).compile()
        for route in ("sdf", "flex")
    }
    flex = models["flex"]
    np.testing.assert_allclose(flex.body_inertia, models["sdf"].body_inertia, rtol=1e-6)
    assert flex.geom("target").contype == flex.geom("target").conaffinity == 0
    for name in set(contact) - {"margin"}:
        np.testing.assert_allclose(getattr(flex, f"flex_{name}")[0], contact[name])
    assert flex_thickness(flex, 0) == pytest.approx(
        0.001 + 0.05 * np.ptp(flex.mesh_vert, axis=0).max()
    )


def test_colliders_work_on_bodies_without_a_name() -> None:
    V, F = peanut(0.06)
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    for parent, name in ((spec.worldbody, "a"), (spec.worldbody.add_body(pos=[0, 0, 1]), "b")):
        parent.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname="shape")
        make_collidable(spec, name, "flex")
    model = spec.compile()
    assert find_flex_colliders(model) == {model.geom("a").id: 0, model.geom("b").id: 1}


def test_a_flex_that_cannot_be_compiled_is_refused_with_the_reason() -> None:
    spec = mesh_spec(peanut(0.06), route=None)
    spec.compiler.discardvisual = True
    with pytest.raises(SceneError, match="discardvisual = False"):
        make_collidable(spec, "target", "flex")
    spec = mesh_spec(peanut(0.06), route=None)
    spec.worldbody.add_geom(name="lost", type=GEOM.mjGEOM_MESH, meshname="nothing")
    with pytest.raises(SceneError, match=r"does not compile: .*nothing"):
        make_collidable(spec, "target", "flex")


MASS = 0.2
SPEED = 1.5


def bowl() -> tuple[np.ndarray, np.ndarray]:
    """Lower half of a ball of 0.5 m."""
    ball = sphere((0.0, 0.0, 0.0), 0.5)
    return opened(
        ball, *polygonise(ball, ((-0.6,) * 3, (0.6,) * 3), 0.08), (0, 0, 0), (0, 0, 1), 0.08
    )


def test_an_open_mesh_collides_through_a_flex_and_a_closed_one_as_a_distance() -> None:
    for shape, flexes in ((bowl(), 1), (peanut(0.1), 0)):
        assert mesh_spec(shape, route="auto").compile().nflex == flexes


@pytest.mark.parametrize("inside", [True, False])
def test_a_ball_gives_a_sheet_the_momentum_that_it_loses_on_either_side(inside: bool) -> None:
    (V, F) = bowl()
    spec = mujoco.MjSpec()
    way = np.array([0.48, 0.36, -0.8])
    spec.option.gravity = [0, 0, 0]
    spec.option.timestep = 0.0005
    spec.add_mesh(name="bowl", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(
        name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="bowl", solref=[0.01, 0.4]
    )
    make_collidable(spec, "target")
    add_ball(spec, "ball", ((0.3 if inside else 0.7) * way).tolist(), solref=[0.01, 0.4], mass=MASS)
    run = Run(spec, "target", resolution=24)
    before = run.data.qvel[:3] = SPEED * (way if inside else -way)
    given = run.until(0.25).given()
    hits = [hit for step in run.hits for hit in step]
    lost = MASS * np.linalg.norm(run.data.qvel[:3] - before)
    assert lost > 1.2 * MASS * SPEED, "it bounced"
    assert given == pytest.approx(lost, rel=0.01)
    np.testing.assert_allclose(np.mean([hit.point for hit in hits], axis=0), 0.5 * way, atol=0.02)
    # what moves outwards there is pushed from the inner side
    assert run.ripples["target"].momentum() == pytest.approx(given if inside else -given, rel=0.01)
    assert {hit.inner for hit in hits} == {inside}


@pytest.mark.parametrize("flat", [False, True])
def test_bodies_drop_on_an_open_mesh(tmp_path, flat: bool) -> None:
    """Also where it is flat, which has neither a volume nor a convex hull."""
    V, F = bowl()
    V, F = (V * [1, 1, 0], F[V[F, 2].mean(axis=1) < -0.25]) if flat else (V, F)
    trimesh.Trimesh(V, F[:, ::-1], process=False).export(tmp_path / "bowl.obj")
    scene = drop_scene(tmp_path / "bowl.obj", bodies=6, up="z")
    assert scene.model.nflex == 1
    # a sheet may throw these aside
    thrown = {int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_CYLINDER)}
    assert not thrown & set(scene.model.geom_type.tolist())
