"""Which flexes stand for a geom, and which do not."""

import warnings

import pytest
from mujoco_models import mesh_spec

from ripple_sim.coupling.model import find_flex_colliders
from ripple_sim.errors import RippleWarning
from ripple_sim.render.visuals.geoms import warn_of_unsupported
from ripple_sim.scenes.shapes import peanut


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
