"""Arguments of `Ripples` that cannot be right."""

import numpy as np
import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, RippleError, Ripples


def test_unknown_key_lists_the_rippling_geoms() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    with pytest.raises(RippleError, match="'target'"):
        Ripples(model, {"target": Material()}, resolution=8, backend="cpu")["ball"]


@pytest.mark.parametrize(
    ("materials", "options", "message"),
    [
        ({"target": 1.0}, {}, "material of geom 'target' is 1.0; valid is a Material"),
        (["target"], {}, "materials is list; valid is a mapping of geom names to Material"),
        ({"target": Material()}, {"resolution": {}}, "resolution has no entry for geom 'target'; it has none"),
        ({"target": Material()}, {"resolution": {"ball": 8}}, "it has 'ball'"),
        ({"target": Material()}, {"resolution": "fine"}, "resolution is 'fine'"),
    ],
)
def test_arguments_of_a_wrong_kind_are_named(materials, options: dict, message: str) -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    with pytest.raises(RippleError, match=message):
        Ripples(model, materials, backend="cpu", **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda ripples: ripples.make_rigid("target", "top", 0.1), "points are 'top'"),
        (lambda ripples: ripples.poke("target", [0.0, np.nan, 0.0], 0.1), "points"),
        (lambda ripples: ripples.to_geom("target", [1.0, 2.0]), "points have shape"),
        (lambda ripples: ripples.hold("target", "all"), "region is 'all'"),
    ],
)
def test_places_that_are_none_are_named(call, message: str) -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    with pytest.raises(RippleError, match=message):
        call(Ripples(model, {"target": Material()}, resolution=8, backend="cpu"))
