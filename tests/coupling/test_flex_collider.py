"""Flex colliders: where they lie, how thick they are, and which cannot be made."""

import igl
import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import mesh_spec

from ripple_sim import make_collidable
from ripple_sim.coupling.colliders import inset
from ripple_sim.coupling.collision_warnings import GAP_TOLERANCE
from ripple_sim.coupling.model import find_flex_colliders, flex_thickness
from ripple_sim.errors import SceneError
from ripple_sim.scenes.shapes import limbed, peanut
from ripple_sim.solver import Mesh

GEOM = mujoco.mjtGeom


def solid(extents: tuple[float, float, float], fineness: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(extents=extents)
    return trimesh.remesh.subdivide_to_size(box.vertices, box.faces, fineness)


@pytest.mark.parametrize("place", [{}, {"pos": [0.3, 0.1, 0.2], "quat": [0.5, 0.5, 0.1, 0.7]}])
def test_flex_lies_as_deep_inside_of_the_mesh_as_it_is_thick(place: dict[str, list[float]]) -> None:
    model = mesh_spec(peanut(0.04), **place).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
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


def test_sides_of_a_thin_part_do_not_change_places() -> None:
    V, F = solid((0.5, 0.4, 0.01), 0.05)
    mesh = Mesh.from_arrays(V, F)
    moved = inset(mesh, 0.03)
    for side in (-1, 1):
        assert (side * moved[side * mesh.V[:, 2] > 0.004, 2]).min() > 0


@pytest.mark.parametrize("shape", ["limbed", "box", "plate"])
def test_flex_is_as_thick_as_the_tolerance_allows(shape: str) -> None:
    V, F = {"limbed": limbed(0.04), "box": solid((0.5, 0.5, 0.5)), "plate": solid((0.5, 0.4, 0.01), 0.05)}[shape]
    model = mesh_spec((V, F)).compile()
    size = np.ptp(V, axis=0).max()
    thickness = flex_thickness(model, 0)
    # corners of a cube lose (sqrt(3) - 1) thicknesses; a plate that thin only gets thicker
    assert thickness / size == pytest.approx({"limbed": 0.05, "box": 0.02, "plate": 0.02}[shape])
    assert (np.sqrt(3) - 1) * 0.02 < GAP_TOLERANCE < (np.sqrt(3) - 1) * 0.03


def test_geom_keeps_its_mass_and_gives_its_contacts_to_the_flex() -> None:
    contact = {"contype": 2, "conaffinity": 5, "condim": 4, "priority": 1, "solref": [-900.0, -20.0], "solmix": 0.5}
    contact |= {"friction": [0.3, 0.02, 0.01], "solimp": [0.8, 0.9, 0.01, 0.4, 3.0], "margin": 0.001, "gap": 0.0}
    models = {route: mesh_spec(peanut(0.05), "free", route, **contact).compile() for route in ("sdf", "flex")}
    np.testing.assert_allclose(models["flex"].body_inertia, models["sdf"].body_inertia, rtol=1e-6)
    flex = models["flex"]
    assert not flex.geom("target").contype
    assert not flex.geom("target").conaffinity
    for name in set(contact) - {"margin"}:
        np.testing.assert_allclose(getattr(flex, f"flex_{name}")[0], contact[name])
    assert flex_thickness(flex, 0) == pytest.approx(0.001 + 0.05 * np.ptp(flex.mesh_vert, axis=0).max())


def test_another_route_leaves_no_flex_behind() -> None:
    spec = mesh_spec(peanut(0.05), contype=2, conaffinity=5)
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
    assert find_flex_colliders(model) == {model.geom("a").id: 0, model.geom("b").id: 1}


def test_flex_that_cannot_be_made_is_refused() -> None:
    spec = mesh_spec(peanut(0.06), route=None)
    spec.compiler.discardvisual = True
    with pytest.raises(SceneError, match="discardvisual = False"):
        make_collidable(spec, "target", "flex")
    spec = mesh_spec(peanut(0.06), route=None)
    spec.worldbody.add_geom(name="lost", type=GEOM.mjGEOM_MESH, meshname="nothing")
    with pytest.raises(SceneError, match=r"does not compile: .*nothing"):
        make_collidable(spec, "target", "flex")
