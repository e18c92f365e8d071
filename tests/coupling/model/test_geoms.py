"""Geoms go by one name each, however they are asked for; those that cannot ripple are refused by name."""

import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, RippleError, Ripples
from ripple_sim.coupling.geoms import by_name, find_geom, geom_name

NAMELESS = """<geom type="plane" size="1 1 1"/>
<body name="torso" pos="0 0 2"><geom name="chest" size="0.1"/><geom size="0.1"/><geom name="torso/3" size="0.1"/>
<geom size="0.1"/><body pos="0 0 1"><geom size="0.1"/></body></body>"""


@pytest.mark.parametrize(
    ("geom", "message"),
    [("nothing", "its geoms are 'target', 'ball'"), ("floor", "plane, which cannot ripple")],
)
def test_geoms_that_cannot_ripple_are_refused_by_name(geom: str, message: str) -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    if geom == "floor":
        model = model_of('<geom name="floor" type="plane" size="1 1 1"/>' + BALL.format("0 0 2"))
    with pytest.raises(RippleError, match=message):
        Ripples(model, {geom: Material()}, resolution=8)


def test_every_geom_has_a_name_of_its_own_by_which_it_is_found() -> None:
    model = model_of(NAMELESS)
    names = [geom_name(model, geom) for geom in range(model.ngeom)]
    # the fourth geom of the torso would be "torso/3", but another one is called so
    assert names == ["world/0", "chest", "torso/1", "torso/3", "geom 4", "geom 5"]
    assert [find_geom(model, name) for name in names] == list(range(6))
    assert find_geom(model, "torso/0") == find_geom(model, np.int64(1)) == 1


def test_names_with_a_slash_as_dm_control_gives_them_are_found() -> None:
    model = model_of('<body name="walker/arm"><geom size="0.1"/><geom name="walker/hand" size="0.1"/></body>')
    assert [geom_name(model, geom) for geom in range(2)] == ["walker/arm/0", "walker/hand"]
    assert [find_geom(model, key) for key in ("walker/arm/0", "walker/arm/1", "walker/hand")] == [0, 1, 1]


@pytest.mark.parametrize("key", ["leg", "torso/4", "torso/-1", "torso/", "/0", 6, -1, None, 1.0, ("chest",)])
def test_a_key_that_is_no_geom_is_named(key: object) -> None:
    with pytest.raises(
        RippleError, match=r"the model has no geom .*its geoms are 'world/0', 'chest', .*\"body/index\""
    ):
        find_geom(model_of(NAMELESS), key)


def test_long_lists_of_geoms_are_cut() -> None:
    model = model_of("".join(f'<geom name="{i:02}" pos="{i} 0 0" size="0.1"/>' for i in range(50)))
    with pytest.raises(RippleError, match="'39' and 10 more"):
        find_geom(model, "x")


def test_a_geom_with_two_values_is_refused() -> None:
    model = model_of(NAMELESS)
    assert by_name(model, {"chest": 1, 2: 5}, "numbers") == {"chest": 1, "torso/1": 5}
    with pytest.raises(RippleError, match="numbers has two entries for geom 'chest', one of them as 1"):
        by_name(model, {"chest": 1, 1: 2}, "numbers")


def test_targets_go_by_name_or_id_or_place() -> None:
    """Ids and unnamed geoms once ended in a TypeError, or could not be asked for."""
    model = model_of('<geom size="0.5"/><body name="b" pos="0.1 0 0.53"><freejoint/><geom size="0.05"/></body>')
    data = mujoco.MjData(model)
    ripples = Ripples(model, {0: Material(), "b/0": Material()}, resolution={"world/0": 8, 1: 12}, backend="cpu")
    assert list(ripples) == ["world/0", "b/0"]
    assert ripples[0] is ripples["world/0"]
    assert ripples[np.int32(1)] is ripples["b/0"]
    assert ripples[1].atlas.areas.shape[-1] == 12
    mujoco.mj_step(model, data)
    ripples.step(data)
    assert [(each.geom, each.other) for each in ripples.last_impulses] == [("world/0", "b/0"), ("b/0", "world/0")]
    ripples.change_material(0, speed=0.5)
    ripples.make_rigid(1, [0, 0, 0.05], 0.02)
    assert ripples[0].material.speed == 0.5
