"""What a model says about its geoms as colliders, and about flexes that stand for some of them.

Which flexes stand for a geom, and which do not.
"""

import warnings

import mujoco
import numpy as np
import pytest
from mujoco_models import add_ball, mesh_spec

from ripple_sim.coupling.model import CoupledModel, find_flex_colliders, flex_thickness
from ripple_sim.errors import RippleWarning
from ripple_sim.render.visuals.geoms import warn_of_unsupported
from ripple_sim.scenes.shapes import peanut


@pytest.fixture(scope="module")
def coupled() -> CoupledModel:
    """A mesh with a flex collider, and a ball, a plane and an SDF geom beside it."""
    spec = mesh_spec(peanut(0.06), "free", contype=2, conaffinity=5, solref=[0.03, 1.0])
    add_ball(spec, "ball", [0, 0, 2], contype=1, conaffinity=0, solref=[0.01, 1.0])
    add_ball(spec, "", [0, 0, 3], contype=0, conaffinity=0)
    add_ball(spec, "pebble", [0, 0, 4], type=mujoco.mjtGeom.mjGEOM_SDF, meshname="shape", contype=8, conaffinity=8)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], contype=2, conaffinity=2)
    return CoupledModel(spec.compile())


def ids(coupled: CoupledModel, *names: str) -> list[int]:
    return [coupled.names.index(name) for name in names]


def test_flex_speaks_for_its_geom(coupled: CoupledModel) -> None:
    [target] = ids(coupled, "target")
    assert coupled.flex_colliders == {target: 0}
    np.testing.assert_array_equal(np.flatnonzero(coupled.has_flex), [target])
    np.testing.assert_allclose(coupled.solref[target], [0.03, 1.0])
    assert coupled.collider_extents[target] == flex_thickness(coupled.model, 0) < coupled.extents[target]
    # the geom's own masks are 0 now
    np.testing.assert_array_equal(np.flatnonzero(coupled.can_collide(target)), sorted(ids(coupled, "ball", "floor")))


def test_geoms_collide_where_either_mask_says_so_but_not_on_one_body(coupled: CoupledModel) -> None:
    ball, pebble = ids(coupled, "ball", "pebble")
    np.testing.assert_array_equal(np.flatnonzero(coupled.can_collide(ball)), ids(coupled, "target"))
    assert coupled.masks_match(pebble)[pebble]
    assert not coupled.can_collide(pebble).any()


def test_extents_names_and_convexity(coupled: CoupledModel) -> None:
    ball, pebble, floor, target = ids(coupled, "ball", "pebble", "floor", "target")
    assert coupled.extents[ball] == pytest.approx(0.04)
    assert coupled.extents[floor] == np.inf
    assert coupled.footprint_radii[ball] == pytest.approx(0.02)
    assert [coupled.convex[geom] for geom in (ball, floor, pebble, target)] == [True, True, False, False]
    assert sum(name.startswith("geom ") for name in coupled.names) == 1


def test_flex_of_another_name_body_or_kind_stands_for_nothing() -> None:
    V, F = peanut(0.06)
    mesh = {"vert": V.ravel(), "elem": F.ravel()}
    spec = mesh_spec((V, F), route=None)
    spec.worldbody.add_body(name="elsewhere")
    spec.add_flex(name="other", dim=2, vertbody=["base"], **mesh)
    assert find_flex_colliders(spec.compile()) == {}
    for body, geom in (("base", {0: 1}), ("elsewhere", {})):
        changed = spec.copy()
        changed.add_flex(name="target", dim=2, vertbody=[body], **mesh)
        assert find_flex_colliders(changed.compile()) == geom


def test_flexes_that_stand_for_geoms_are_not_missed_in_the_picture() -> None:
    spec = mesh_spec(peanut(0.06))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_unsupported(spec.compile())
    V, F = peanut(0.06)
    spec.add_flex(name="other", dim=2, vertbody=["base"], vert=V.ravel(), elem=F.ravel())
    with pytest.warns(RippleWarning, match="has 1 flexes"):
        warn_of_unsupported(spec.compile())
