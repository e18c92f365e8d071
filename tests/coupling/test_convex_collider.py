"""A mesh that collides as its convex parts: stable, in place, and undone completely."""

import importlib.metadata

import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import add_ball, mesh_spec

from ripple_sim import RippleError, make_collidable
from ripple_sim.coupling import CoupledModel, colliders, convex_parts
from ripple_sim.scenes.shapes import peanut
from ripple_sim.solver import Mesh

pytest.importorskip("coacd")

GEOM = mujoco.mjtGeom
WAIST = peanut(0.06)


def ell() -> tuple[np.ndarray, np.ndarray]:
    """An L of 0.6 m: two boxes, exactly."""
    outline = np.array([(0, 0), (0.6, 0), (0.6, 0.2), (0.2, 0.2), (0.2, 0.6), (0, 0.6)])
    corners = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    solid = trimesh.creation.extrude_triangulation(outline, corners, 0.3)
    return solid.subdivide_to_size(0.1).vertices, solid.subdivide_to_size(0.1).faces


def test_convex_parts_fill_the_solid_are_reproducible_and_cached(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    mesh = Mesh.from_arrays(*ell())
    first = convex_parts(mesh)
    [file] = (tmp_path / "ripple-sim").iterdir()
    file.unlink()
    second = convex_parts(mesh)
    assert len(first) == len(second) == 2
    volume = sum(trimesh.convex.convex_hull(part).volume for part in first)
    assert volume == pytest.approx(0.3 * (0.36 - 0.16), rel=0.03)
    monkeypatch.setattr("coacd.run_coacd", lambda *_, **__: pytest.fail("the cache was not used"))
    for one, two, three in zip(first, second, convex_parts(mesh), strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(pytest.fail.Exception):
        convex_parts(mesh)


def test_a_missing_package_is_named_with_the_way_to_install_it(monkeypatch) -> None:
    def missing(_: str) -> str:
        raise importlib.metadata.PackageNotFoundError

    monkeypatch.setattr(colliders.importlib.metadata, "version", missing)
    with pytest.raises(
        RippleError, match=r"needs coacd.*pip install 'ripple-sim\[convex\]'.*'sdf'"
    ):
        make_collidable(mesh_spec(WAIST, route=None), "target", "convex")


def test_the_geom_keeps_its_mass_and_looks_and_convex_parts_inherit_its_contacts() -> None:
    settings = {
        "friction": [0.3, 0.01, 0.001],
        "solref": [0.015, 0.7],
        "condim": 4,
        "contype": 3,
        "conaffinity": 5,
    }
    plain = mesh_spec(WAIST, "free", None, **settings).compile()
    model = mesh_spec(WAIST, "free", "convex", **settings).compile()
    coupled = CoupledModel(model)
    [(geom, parts)] = coupled.convex_colliders.items()
    assert coupled.names[geom] == "target"
    assert len(parts) > 1
    body = model.body("base").id
    for each in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_array_equal(getattr(model, each)[body], getattr(plain, each)[body])
    assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0
    for name, value in settings.items():
        np.testing.assert_allclose(
            getattr(model, f"geom_{name}")[parts], np.tile(value, (len(parts), 1)).squeeze()
        )
    assert (model.geom_group[parts] == 3).all(), "a group that is not drawn"
    assert not coupled.convex[geom]


@pytest.mark.parametrize("route", ["sdf", "flex", "hull", "convex"])
@pytest.mark.parametrize("earlier", ["convex", "flex"])
def test_a_new_collider_replaces_the_earlier_one_completely(earlier: str, route: str) -> None:
    def content(spec: mujoco.MjSpec) -> list[object]:
        model = spec.compile()
        arrays = model.geom_type, model.geom_contype, model.geom_conaffinity, model.geom_pos
        return [CoupledModel(model).names, model.nflex, *(each.tolist() for each in arrays)]

    direct, detour = (mesh_spec(WAIST, "free", None, contype=2, conaffinity=5) for _ in range(2))
    make_collidable(direct, "target", route)
    make_collidable(detour, "target", earlier)
    make_collidable(detour, "target", route)
    assert content(detour) == content(direct)


@pytest.mark.parametrize("joint", [None, "free"])
def test_balls_give_their_momentum_where_they_hit_the_visible_surface(
    joint: str | None,
) -> None:
    spec = mesh_spec(WAIST, joint, "convex", condim=1)
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "ball", [0, 0, 0], condim=1)
    run = Run(spec, "target", resolution=32)
    rng = np.random.default_rng(1)
    off = []
    model = run.model
    data = run.data
    waves = run.ripples["target"]
    atlas = waves.atlas
    ball = data.joint(model.body("ball").jntadr[0])
    target = data.geom("target")
    # not on the waist, where a ball touches two pieces at once: their impulses have no one
    # direction
    lobes = np.flatnonzero(np.abs(atlas.positions[..., 0]) > 0.1)
    for _ in range(6):
        mujoco.mj_resetData(model, data)
        mujoco.mj_forward(model, data)
        run.ripples.reset()
        rotation = target.xmat.reshape(3, 3)
        given = 0.0
        lost = 0.0
        texel = rng.choice(lobes)
        aim = waves.to_world(atlas.positions.reshape(-1, 3)[texel], data)
        way = rotation @ atlas.normals.reshape(-1, 3)[texel] + 0.3 * rng.standard_normal(3)
        way /= np.linalg.norm(way)
        ball.qpos[:3] = aim + 0.5 * way
        ball.qvel[:3] = -3.0 * way
        while data.time < 0.4:
            before = ball.qvel[:3].copy()
            for hit in run.step():
                given += hit.impulse
                nearest, _ = atlas.project(waves.from_world(data.geom("ball").xpos))
                off.append(np.linalg.norm(waves.from_world(hit.point) - nearest))
            lost += 0.2 * np.linalg.norm(ball.qvel[:3] - before)
        assert lost > 0.3
        assert given == pytest.approx(lost, rel=0.01)
    assert run.pairs == {("target", "ball")}
    assert np.median(off) < 0.01 * np.ptp(atlas.mesh.V, axis=0).max()
    assert np.quantile(off, 0.95) < 0.03 * np.ptp(atlas.mesh.V, axis=0).max()


def test_boxes_stack_on_a_concave_target_and_press_with_their_weight() -> None:
    spec = mujoco.MjSpec()
    V, F = ell()
    spec.add_mesh(name="ell", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=GEOM.mjGEOM_MESH, meshname="ell", quat=[1, 0, 0, 0])
    make_collidable(spec, "target", "convex")
    for i in range(4):
        add_ball(
            spec,
            f"box {i}",
            [0.1, 0.4, 0.35 + 0.1 * i],
            type=GEOM.mjGEOM_BOX,
            size=[0.05, 0.05, 0.05],
            mass=1.0,
        )
    run = Run(spec, "target", density=100, resolution=24).until(1.5)
    weights = [sum(hit.impulse for hit in hits) / run.model.opt.timestep for hits in run.hits]
    np.testing.assert_allclose([hit.point[2] for hits in run.hits for hit in hits], 0.3, atol=1e-6)
    assert np.mean(weights[-200:]) == pytest.approx(4 * 9.81, rel=0.01)
    assert np.abs(run.data.qpos.reshape(4, 7)[:, :2] - [0.1, 0.4]).max() < 0.01


def test_an_unnamed_visual_geom_is_found_by_its_place_and_collides() -> None:
    spec = mesh_spec(WAIST, "free", None, contype=0, conaffinity=0)
    spec.geom("target").name = ""
    geom = make_collidable(spec, "base/0", "hull")
    assert (geom.name, geom.contype, geom.conaffinity) == ("base/0", 1, 1)
    assert CoupledModel(spec.compile()).names == ["base/0"]


def test_an_open_mesh_is_refused_with_the_routes_that_take_it() -> None:
    V, F = ell()
    lid = V[F].mean(axis=1)[:, 2] > 0.3 - 1e-9
    with pytest.raises(
        RippleError, match=r"mesh of geom 'target' is open .* its routes are 'flex' and 'hull'"
    ):
        make_collidable(mesh_spec((V, F[~lid]), None, None), "target", "convex")


def test_parts_leave_the_hole_of_a_ring_open() -> None:
    ring = trimesh.creation.torus(0.3, 0.1, major_sections=16, minor_sections=8)
    V = np.array(ring.vertices)
    F = np.array(ring.faces)
    parts = [trimesh.convex.convex_hull(part) for part in convex_parts(Mesh.from_arrays(V, F))]
    assert len(parts) > 3
    assert not any(part.contains([[0.0, 0.0, 0.0], [0.05, 0.05, 0.0]]).any() for part in parts)
    assert sum(part.volume for part in parts) == pytest.approx(ring.volume, rel=0.2)
