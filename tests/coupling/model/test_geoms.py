"""Geoms that cannot ripple are refused by name."""

import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, RippleError, Ripples


@pytest.mark.parametrize(
    ("geom", "message"),
    [("nothing", "named geoms are 'target', 'ball'"), ("floor", "plane, which cannot ripple")],
)
def test_geoms_that_cannot_ripple_are_refused_by_name(geom: str, message: str) -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    if geom == "floor":
        model = model_of('<geom name="floor" type="plane" size="1 1 1"/>' + BALL.format("0 0 2"))
    with pytest.raises(RippleError, match=message):
        Ripples(model, {geom: Material()}, resolution=8)
