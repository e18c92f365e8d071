"""The way to the true surface."""

import mujoco
import numpy as np
import pytest
from mujoco_models import add_ball, mesh_spec

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling import colliders
from ripple_sim.errors import SceneError
from ripple_sim.scenes.shapes import limbed, peanut


def spec_of(V: np.ndarray, F: np.ndarray) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="shape")
    spec.worldbody.add_geom(name="knob", size=[0.01, 0, 0], pos=[0, 0, 9])
    return spec


def rest_height(model: mujoco.MjModel) -> float:
    """Height at which the ball of radius 0.02 m first touches something."""
    data = mujoco.MjData(model)
    while data.time < 2 and not any(contact.dist < contact.includemargin for contact in data.contact):
        mujoco.mj_step(model, data)
    return float(data.body("ball").xpos[2]) - 0.02


def throw(model: mujoco.MjModel) -> tuple[float, float, float]:
    """What a ball gives to the target and loses, and the share of its speed with which it comes back."""
    data, given = mujoco.MjData(model), 0.0
    ripples = Ripples(model, {"target": Material(density=50)}, resolution=8, backend="cpu")
    data.qvel[2] = -1.5
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(impulse.impulse for impulse in ripples.last_impulses)
    return given, 0.1 * float(np.linalg.norm(data.qvel[:3] - [0, 0, -1.5])), data.qvel[2] / 1.5


def test_body_comes_down_on_the_surface_that_the_route_promises() -> None:
    # the waist of the peanut, 0.045 m below its hull
    V, F = peanut(0.04)
    waist = V[np.abs(V[:, 0]) < 0.03][:, 2].max()
    heights = {}
    for route in ("sdf", "flex", "hull"):
        spec = spec_of(V, F)
        make_collidable(spec, "target", route)
        ball = spec.worldbody.add_body(name="ball", pos=[0, 0, 0.35])
        ball.add_freejoint()
        ball.add_geom(size=[0.02, 0, 0], mass=0.1)
        heights[route] = rest_height(spec.compile())
    assert heights["sdf"] == pytest.approx(waist, abs=0.012)
    assert heights["flex"] == pytest.approx(waist, abs=0.012)
    assert heights["hull"] == pytest.approx(V[:, 2].max(), abs=0.012)
    assert heights["hull"] - heights["sdf"] > 0.03


@pytest.mark.parametrize(("solref", "restitution"), [([0.02, 1.0], 0.13), ([-40000.0, -90.0], 0.5)])
def test_routes_agree_where_the_hull_is_the_surface(solref: list[float], restitution: float) -> None:
    V, F = peanut(0.05)
    results = {}
    for route in ("sdf", "flex", "hull"):
        spec = spec_of(0.3 * V / np.linalg.norm(V, axis=1, keepdims=True), F)
        spec.option.gravity = [0, 0, 0]
        spec.geom("target").solref = solref
        make_collidable(spec, "target", route)
        ball = spec.worldbody.add_body(name="ball", pos=[0.001, 0.002, 0.4])
        ball.add_freejoint()
        ball.add_geom(size=[0.04, 0, 0], mass=0.1, solref=solref, condim=1)
        results[route] = throw(spec.compile())
    given, lost, back = np.array(list(results.values())).T
    np.testing.assert_allclose(given, lost, rtol=0.03)
    np.testing.assert_allclose(back, restitution, atol=0.1)


@pytest.mark.parametrize("route", ["auto", "flex", "convex"])
@pytest.mark.parametrize("earlier", ["flex", "hull"])
def test_a_route_that_fails_leaves_the_earlier_one(earlier: str, route: str) -> None:
    V, F = peanut(0.1)
    spec = mesh_spec((V, F[:-40]), route=earlier)  # open: it has no convex parts
    if route != "convex":
        spec.worldbody.add_geom(name="broken", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="none")
    geom = spec.geom("target")

    def state() -> tuple[int, ...]:
        return geom.type, geom.contype, geom.conaffinity, spec.option.enableflags, len(spec.flexes), len(spec.geoms)

    before = state()
    with pytest.raises(SceneError):
        make_collidable(spec, "target", route)
    assert state() == before


def test_starting_points_are_lowered_but_never_raised() -> None:
    spec = spec_of(*peanut(0.05))
    make_collidable(spec, "target")
    assert spec.option.sdf_initpoints == 10
    spec.option.sdf_initpoints = 6
    make_collidable(spec, "target")
    assert spec.option.sdf_initpoints == 6


def test_primitives_are_left_alone() -> None:
    spec = spec_of(*peanut(0.05))
    assert make_collidable(spec, "knob").type == mujoco.mjtGeom.mjGEOM_SPHERE


def test_fast_bodies_are_stopped_by_speculative_contacts_where_there_are_any(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(colliders, "SPECULATIVE", 1 << 20)
    for geom, route, enabled in (("target", "sdf", False), ("target", "hull", True), ("knob", "sdf", True)):
        spec = spec_of(*peanut(0.05))
        make_collidable(spec, geom, route)
        assert bool(spec.option.enableflags & 1 << 20) == enabled


@pytest.mark.parametrize(
    ("geom", "route", "message"),
    [
        ("nose", "sdf", "geoms are 'target', 'knob'"),
        ("target", "ghost", "valid are 'auto', 'sdf', 'flex', 'convex', 'hull'"),
    ],
)
def test_unknown_names_are_refused(geom: str, route: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make_collidable(spec_of(*peanut(0.05)), geom, route)


@pytest.mark.parametrize(("mesh", "points"), [(False, 10), (True, 50)])
def test_mujoco_has_room_for_the_contacts_of_meshes_with_a_signed_distance(mesh: bool, points: int) -> None:
    spec = mesh_spec(limbed(0.1), route=None)
    body = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "shape"} if mesh else {}
    add_ball(spec, "other", [0, 0, 2], **body)
    make_collidable(spec, "target", "sdf")
    assert spec.option.sdf_initpoints == points
