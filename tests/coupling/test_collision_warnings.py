"""Targets that collide other than as their true surface are warned of."""

import warnings

import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, add_ball, mesh_spec, model_of

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling.collision_warnings import hull_gap
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


SEEN = 'contype="0" conaffinity="0"'
LINK = '<body name="link">{}</body>' + BALL.format("0 0 2")


@pytest.mark.parametrize(
    ("link", "contacts", "message"),
    [
        (f'<geom name="shell" size="0.3" {SEEN}/>', {}, r"does not collide .*contacts=\{'shell': \[\.\.\.\]\}"),
        ('<geom name="shell" size="0.3" contype="4" conaffinity="4"/>', {}, "'shell' has contype 4 and conaffinity 4"),
        (
            f'<geom name="shell" size="0.3" {SEEN}/><geom name="core" size="0.29" contype="0" conaffinity="2"/>',
            {},
            "nothing can touch geom 'shell': 'core' has contype 0 and conaffinity 2, which match no geom",
        ),
        (f'<geom name="shell" size="0.3" {SEEN}/><geom size="0.3"/>', {"shell": []}, "nothing can touch geom 'shell'"),
    ],
)
def test_target_that_nothing_can_touch_says_so(link: str, contacts: dict, message: str) -> None:
    with pytest.warns(RippleWarning, match=message):
        Ripples(model_of(LINK.format(link)), {"shell": Material()}, contacts=contacts, resolution=8, backend="cpu")


@pytest.mark.parametrize(
    ("core", "gap"),
    [
        ('<geom name="core" size="0.2"/>', "0.1 m"),
        ('<geom name="core" size="0.4"/>', "0.1 m"),
        ('<geom name="core" size="0.3" pos="0 0 0.12"/>', "0.12 m"),
        ('<geom name="core" type="box" size="0.28 0.28 0.28"/>', None),
        ('<geom name="core" size="0.3" pos="0 0 0.02"/><geom name="other" size="0.2"/>', None),
        # named below, since planes and height fields are not taken by themselves
        ('<geom name="core" type="plane" size="1 1 1" pos="0 0 0.29"/>', None),
        ('<geom name="core" type="hfield" hfield="flat" pos="0 0 0.29"/>', None),
    ],
)
def test_collision_geoms_off_the_surface_are_warned_of(core: str, gap: str | None) -> None:
    model = model_of(
        LINK.format(f'<geom name="shell" size="0.3" {SEEN}/>{core}'),
        '<hfield name="flat" nrow="2" ncol="2" size="1 1 0.1 0.1"/>',
    )
    contacts = {"shell": ["core"]} if "plane" in core or "hfield" in core else None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Ripples(model, {"shell": Material()}, contacts=contacts, resolution=16, backend="cpu")
    messages = [str(each.message) for each in caught]
    assert len(messages) == (gap is not None)
    if gap is not None:
        assert "'shell' collides as 'core'" in messages[0]
        assert float(messages[0].split("up to ")[1].split()[0]) == pytest.approx(float(gap.split()[0]), rel=0.05)


def test_sdf_geoms_that_height_fields_let_through_are_warned_of() -> None:
    spec = mesh_spec(peanut(0.06), "free", "sdf")
    spec.add_hfield(name="hills", nrow=2, ncol=2, size=[1, 1, 0.1, 0.1], userdata=[0, 1, 1, 0])
    spec.worldbody.add_geom(name="hills", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hills")
    with pytest.warns(RippleWarning, match=r"SDF geom 'target' with height fields \('hills'\).*\"flex\""):
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
