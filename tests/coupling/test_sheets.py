"""Open meshes collide as sheets: from both sides, at the rim, and with the right impulse."""

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import add_ball
from vessels import opened

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scenes.shapes import polygonise, sphere

MASS, SPEED = 0.2, 1.5


def bowl() -> tuple[np.ndarray, np.ndarray]:
    """Lower half of a ball of 0.5 m."""
    ball = sphere((0.0, 0.0, 0.0), 0.5)
    return opened(ball, *polygonise(ball, ((-0.6,) * 3, (0.6,) * 3), 0.08), (0, 0, 0), (0, 0, 1), 0.08)


def model_of_bowl(start: list[float]) -> mujoco.MjModel:
    V, F = bowl()
    spec = mujoco.MjSpec()
    spec.option.gravity, spec.option.timestep = [0, 0, 0], 0.0005
    spec.add_mesh(name="bowl", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="bowl", solref=[0.01, 0.4])
    make_collidable(spec, "target")
    add_ball(spec, "ball", start, solref=[0.01, 0.4], mass=MASS)
    return spec.compile()


@pytest.mark.parametrize(("closed", "flexes"), [(False, 1), (True, 0)])
def test_an_open_mesh_collides_through_a_flex_and_a_closed_one_as_a_distance(closed: bool, flexes: int) -> None:
    box = trimesh.creation.box()
    V, F = (box.vertices, box.faces) if closed else bowl()
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", uservert=np.ravel(V), userface=np.ravel(F))
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    make_collidable(spec, "target")
    assert spec.compile().nflex == flexes


@pytest.mark.parametrize("inside", [True, False])
def test_a_ball_gives_a_sheet_the_momentum_that_it_loses_on_either_side(inside: bool) -> None:
    way = np.array([0.48, 0.36, -0.8])
    start = (0.3 if inside else 0.7) * way
    model = model_of_bowl(start.tolist())
    data = mujoco.MjData(model)
    data.qvel[:3] = SPEED * (way if inside else -way)
    before = data.qvel[:3].copy()
    ripples = Ripples(model, {"target": Material(density=50)}, resolution=24, backend="cpu", conserve_volume=False)
    given, points, sides = 0.0, [], set()
    while data.time < 0.25:
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(each.impulse for each in ripples.last_impulses)
        points += [each.point for each in ripples.last_impulses]
        sides |= {each.inner for each in ripples.last_impulses}
    lost = MASS * np.linalg.norm(data.qvel[:3] - before)
    assert lost > 1.2 * MASS * SPEED, "it bounced"
    assert given == pytest.approx(lost, rel=0.01)
    np.testing.assert_allclose(np.mean(points, axis=0), 0.5 * way, atol=0.02)
    # what moves outwards there is pushed from the inner side
    assert ripples["target"].momentum() == pytest.approx(given if inside else -given, rel=0.01)
    assert sides == {inside}


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
