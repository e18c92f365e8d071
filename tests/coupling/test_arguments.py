"""Arguments of `Ripples` that cannot be right."""

import copy
import pickle

import mujoco
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


SCENE = '<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2")


def stepping(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Step the ripples of a model with some data."""
    ripples = Ripples(model, {"target": Material(speed=1.0, density=100.0)}, resolution=8, backend="cpu")
    mujoco.mj_step(model, data)
    ripples.step(data)


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [('mass="0.3"', 'mass="0.6"', "body_"), ('size="0.5"', 'size="0.4"', "geom_"), ("0 0 2", "0 0 3", "body_pos")],
)
def test_data_of_a_model_compiled_with_another_number_is_refused(before: str, after: str, what: str) -> None:
    other = model_of(SCENE.replace(before, after))
    with pytest.raises(RippleError, match=f"belongs to another model .* of another {what}"):
        stepping(model_of(SCENE), mujoco.MjData(other))


@pytest.mark.parametrize(
    "make",
    [
        lambda model: mujoco.MjData(model_of(SCENE)),  # compiled again
        lambda model: mujoco.MjData(copy.copy(model)),
        lambda model: copy.copy(mujoco.MjData(model)),
        lambda model: copy.deepcopy(mujoco.MjData(model)),
        lambda model: pickle.loads(pickle.dumps(mujoco.MjData(model))),
        lambda model: mujoco.MjData(pickle.loads(pickle.dumps(model))),
    ],
    ids=["compiled again", "copied model", "copied data", "deep copy", "pickled data", "pickled model"],
)
def test_data_of_a_copy_is_as_good_as_the_model_s_own(make) -> None:
    model = model_of(SCENE)
    stepping(model, make(model))


def test_a_model_may_be_changed_in_place() -> None:
    """As domain randomisation does; data of a copy that was taken once is taken on."""
    model = model_of(SCENE)
    ripples = Ripples(model, {"target": Material(speed=1.0, density=100.0)}, resolution=8, backend="cpu")
    for data in (mujoco.MjData(model), mujoco.MjData(copy.copy(model))):
        ripples.step(data)
        model.body_mass[1] *= 1.1
        ripples.step(data)
        model.body_mass[1] /= 1.1
