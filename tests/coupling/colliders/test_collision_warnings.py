"""Targets that collide other than as their true surface are warned of."""

import warnings

import mujoco
import numpy as np
import pytest
from mujoco_models import add_ball, mesh_spec

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling.colliders.collision_warnings import hull_gap
from ripple_sim.errors import RippleWarning
from ripple_sim.scenes.shapes import limbed, peanut
from ripple_sim.solver import Mesh, build_atlas


def test_hull_over_a_waist_is_as_far_off_as_the_waist_is_deep() -> None:
    V, F = peanut(0.03)
    widest = np.hypot(V[:, 1], V[:, 2]).max()
    waist = np.hypot(V[:, 1], V[:, 2])[np.abs(V[:, 0]) < 0.01].min()
    atlas = build_atlas(Mesh.from_arrays(V, F), 16, cache=False)
    assert hull_gap(atlas) == pytest.approx(widest - waist, rel=0.1)


def test_hull_that_matters_is_warned_of_by_name_and_distance() -> None:
    model = mesh_spec(limbed(0.05), route=None).compile()
    with pytest.warns(RippleWarning, match=r"geom 'target'.*hull, up to 0\.\d+ m.*make_collidable"):
        Ripples(model, {"target": Material()}, resolution=8, backend="cpu")


def test_no_warning_without_a_gap_or_without_collisions() -> None:
    V, F = peanut(0.05)
    convex = mesh_spec((0.3 * V / np.linalg.norm(V, axis=1, keepdims=True), F), route=None)
    ghost = mesh_spec(limbed(0.05), route=None)
    ghost.geom("target").contype = ghost.geom("target").conaffinity = 0
    true = mesh_spec(limbed(0.05), route=None)
    make_collidable(true, "target")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for spec in (convex, ghost, true):
            Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")


def test_geoms_that_a_flex_meets_badly_are_named() -> None:
    spec = mesh_spec(peanut(0.06), "free")
    base = spec.body("base")
    arm = base.add_body(name="arm", pos=[0, 0, 0.5])
    arm.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)
    arm.add_geom(name="arm", size=[0.05, 0, 0], mass=0.1)
    base.add_body(name="horn", pos=[0, 0, 0.4]).add_geom(name="horn", size=[0.05, 0, 0], mass=0.1)
    add_ball(spec, "excluded", [0, 0, 2])
    spec.add_exclude(bodyname1="excluded", bodyname2="base")
    add_ball(spec, "ball", [0, 0, 3])
    add_ball(spec, "pebble", [0, 0, 4], type=mujoco.mjtGeom.mjGEOM_SDF, meshname="shape")
    add_ball(spec, "crate", [0, 0, 5], type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    with pytest.warns(RippleWarning) as caught:
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
    [message] = [str(warning.message) for warning in caught]
    assert "'target' collides through a flex" in message
    assert "boxes ('crate') aside" in message
    assert "SDF geoms ('pebble') sink" in message
    assert "excluded ('arm', 'excluded')" in message
    for geom in ("crate", "pebble", "arm", "excluded"):
        spec.geom(geom).contype = spec.geom(geom).conaffinity = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
