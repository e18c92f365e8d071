"""Names of geoms, collision geoms of targets, and messages for invalid arguments."""

import copy
import pickle

import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, add_ball, mesh_spec, model_of

from ripple_sim import Material, RippleError, Ripples, Target, coupling
from ripple_sim.coupling import CoupledModel, find_geom, geom_name
from ripple_sim.scenes.shapes import peanut

NAMELESS = """<geom type="plane" size="1 1 1"/>
<body name="torso" pos="0 0 2"><geom name="chest" size="0.1"/><geom size="0.1"/>
<geom name="torso/3" size="0.1"/>
<geom size="0.1"/><body pos="0 0 1"><geom size="0.1"/></body></body>"""


def test_every_geom_is_found_by_its_own_name() -> None:
    model = model_of(NAMELESS)
    names = [geom_name(model, geom) for geom in range(model.ngeom)]
    # the fourth geom of the torso would be "torso/3", but another one is called so
    assert names == ["world/0", "chest", "torso/1", "torso/3", "geom 4", "body 2/0"]
    assert [find_geom(model, name) for name in names] == list(range(6))
    assert find_geom(model, "geom 5") == 5
    assert find_geom(model, "torso/0") == find_geom(model, np.int64(1)) == 1
    # names with a slash, as dm_control gives them
    model = model_of(
        '<body name="walker/arm"><geom size="0.1"/><geom name="walker/hand" size="0.1"/></body>'
    )
    assert [geom_name(model, geom) for geom in range(2)] == ["walker/arm/0", "walker/hand"]
    assert [find_geom(model, key) for key in ("walker/arm/0", "walker/arm/1", "walker/hand")] == [
        0,
        1,
        1,
    ]


@pytest.mark.parametrize(
    "key", ["leg", "torso/4", "torso/-1", "torso/", "/0", 6, -1, None, 1.0, ("chest",)]
)
def test_a_key_that_is_no_geom_is_named(key: object) -> None:
    message = r"the model has no geom .*its geoms are 'world/0', 'chest', .*\"body/index\""
    with pytest.raises(RippleError, match=message):
        find_geom(model_of(NAMELESS), key)


def test_long_lists_of_geoms_are_cut() -> None:
    model = model_of("".join(f'<geom name="{i:02}" pos="{i} 0 0" size="0.1"/>' for i in range(50)))
    with pytest.raises(RippleError, match="'39' and 10 more"):
        find_geom(model, "x")


def test_a_geom_with_two_values_is_refused() -> None:
    model = model_of(NAMELESS)
    assert coupling.by_name(model, {"chest": 1, 2: 5}, "numbers") == {"chest": 1, "torso/1": 5}
    with pytest.raises(
        RippleError, match="numbers must have one entry for geom 'chest', got two, one of them as 1"
    ):
        coupling.by_name(model, {"chest": 1, 1: 2}, "numbers")


def test_targets_are_chosen_by_name_by_id_or_by_place_on_a_body() -> None:
    """Ids and unnamed geoms once ended in a TypeError, or could not be asked for."""
    model = model_of(
        '<geom size="0.5"/><body name="b" pos="0.1 0 0.53"><freejoint/><geom size="0.05"/></body>'
    )
    data = mujoco.MjData(model)
    targets = {0: Target(resolution=8), "b/0": Target(resolution=12)}
    ripples = Ripples(model, targets, backend="cpu")
    assert list(ripples) == ["world/0", "b/0"]
    assert ripples[0] is ripples["world/0"]
    assert ripples[np.int32(1)] is ripples["b/0"]
    assert ripples[1].atlas.areas.shape[-1] == 12
    mujoco.mj_step(model, data)
    ripples.step(data)
    assert [(each.geom, each.other) for each in ripples.last_impulses] == [
        ("world/0", "b/0"),
        ("b/0", "world/0"),
    ]
    ripples.change_material(0, speed=0.5)
    ripples.make_rigid(1, [0, 0, 0.05], 0.02)
    assert ripples[0].material.speed == 0.5


SEEN = 'contype="0" conaffinity="0"'
ROBOT = f"""<geom name="floor" type="plane" size="1 1 1"/>
<geom name="statue" size="0.5" pos="3 0 0.5" {SEEN}/><geom name="core" size="0.4" pos="3 0 0.5"/>
<geom name="wall" type="box" size="0.1 2 2" pos="-3 0 0"/>
<body name="link" pos="0 0 1"><freejoint/>
  <geom name="shell" size="0.2" {SEEN}/><geom name="cap" size="0.2" pos="0 0 0.2" {SEEN}/>
  <geom name="hull0" size="0.19"/><geom name="hull1" size="0.1"/>
  <body name="tool"><geom name="blade" size="0.1" {SEEN}/>
    <body name="guard"><geom name="guard" size="0.05"/></body></body>
  <body name="finger"><joint/><geom name="nail" size="0.1" {SEEN}/><geom name="pad" size="0.1"/>
  </body>
</body>"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return model_of(ROBOT)


@pytest.mark.parametrize(
    ("targets", "contacts", "expected"),
    [
        (("shell",), {}, [["hull0", "hull1"]]),
        (("shell", "cap"), {}, [["hull0", "hull1"], ["hull0", "hull1"]]),
        (("hull0",), {}, [["hull0"]]),
        # what ripples itself keeps its contacts, and what one target names is not for the others
        (("shell", "hull0"), {}, [["hull1"], ["hull0"]]),
        (("shell", "cap"), {"cap": ["hull1"]}, [["hull0"], ["hull1"]]),
        (("shell",), {"shell": ["hull1", "link/3", "guard"]}, [["hull1", "guard"]]),
        (("shell",), {"shell": []}, [[]]),
        (("hull0",), {"hull0": ["hull1"]}, [["hull0", "hull1"]]),
        # the blade's body has no collision geom: it takes those of bodies welded to it, without the
        # finger's
        (("blade",), {}, [["hull0", "hull1", "guard"]]),
        (("nail",), {}, [["pad"]]),
        # geoms of the world need not belong together
        (("statue",), {}, [["core"]]),
        (("wall",), {}, [["wall"]]),
    ],
)
def test_collision_geoms_of_targets_are_found(model, targets, contacts, expected) -> None:
    ids = [find_geom(model, name) for name in targets]
    coupled = CoupledModel(model, ids, coupling.named_collision_geoms(model, targets, contacts))
    assert [
        [coupled.names[geom] for geom in coupled.collision_geoms(target)] for target in ids
    ] == expected


def test_an_explicit_pair_collides_despite_its_masks() -> None:
    seen = f'<body name="a"><freejoint/><geom name="a" size="0.1" {SEEN}/></body>'
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody>{seen}<geom name="b" size="0.1" {SEEN}/>
        <geom name="c" size="0.1" {SEEN}/></worldbody>
        <contact><pair geom1="b" geom2="a"/></contact></mujoco>"""
    )
    coupled = CoupledModel(spec.compile(), [0, 1, 2])
    a, b, c = (coupled.names.index(name) for name in "abc")
    assert [coupled.collision_geoms(geom) for geom in (a, b, c)] == [(a,), (b,), ()]
    np.testing.assert_array_equal(np.flatnonzero(coupled.can_collide(a)), [b])
    assert not coupled.can_collide(c).any()


@pytest.mark.parametrize(
    ("contacts", "message"),
    [
        (
            {"shell": ["pad"]},
            "must be geoms of body 'link' .*, got geom 'pad' on body 'finger', which moves",
        ),
        ({"shell": ["cap"]}, "names geom 'cap', which ripples itself"),
        ({"shell": ["hull2"]}, "no geom 'hull2'; its geoms are"),
        (
            {"blade": ["guard"]},
            "geom 'blade', which does not ripple; the rippling geoms are 'shell', 'cap'",
        ),
        ({"shell": "hull0"}, "contacts of geom 'shell' must be a list of geoms, got 'hull0'"),
        ({"shell": 3}, "contacts of geom 'shell' must be a list of geoms, got 3"),
        ({"shell": ["hull0"], 4: []}, "contacts must have one entry for geom 'shell', got two"),
        (["shell"], r"contacts must be a mapping .*, got \['shell'\]"),
    ],
)
def test_invalid_contacts_are_named(model, contacts, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        Ripples(
            model,
            {"shell": Material(), "cap": Material()},
            contacts=contacts,
            resolution=8,
            backend="cpu",
        )


SCENE = '<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2")


@pytest.mark.parametrize(
    ("materials", "options", "message"),
    [
        ({"target": 1.0}, {}, "material of geom 'target' must be a Material or a Target, got 1.0"),
        (["target"], {}, "materials must be a mapping of geom names to Material .*, got list"),
        (
            {"target": Material()},
            {"resolution": {}},
            "resolution has no entry for geom 'target'; it has none",
        ),
        ({"target": Material()}, {"resolution": {"ball": 8}}, "it has 'ball'"),
        ({"target": Material()}, {"resolution": "fine"}, "resolution must be .*, got 'fine'"),
    ],
)
def test_arguments_of_a_wrong_kind_are_named(materials, options: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        Ripples(model_of(SCENE), materials, backend="cpu", **options)


def begun(model: mujoco.MjModel) -> Ripples:
    return Ripples(
        model, {"target": Material(speed=1.0, density=100.0)}, resolution=8, backend="cpu"
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda ripples: ripples.make_rigid("target", "top", 0.1), "points must be .*, got 'top'"),
        (lambda ripples: ripples.poke("target", [0.0, np.nan, 0.0], 0.1), "points"),
        (lambda ripples: ripples.to_geom("target", [1.0, 2.0]), "points must have shape"),
        (lambda ripples: ripples.hold("target", "all"), "region must be .*, got 'all'"),
        (lambda ripples: ripples["ball"], "'target'"),
    ],
)
def test_invalid_places_and_keys_are_named(call, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        call(begun(model_of(SCENE)))


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [
        ('mass="0.3"', 'mass="0.6"', "body_"),
        ('size="0.5"', 'size="0.4"', "geom_"),
        ("0 0 2", "0 0 3", "body_pos"),
    ],
)
def test_data_of_a_model_with_another_number_of_elements_is_refused(
    before: str, after: str, what: str
) -> None:
    other = model_of(SCENE.replace(before, after))
    with pytest.raises(RippleError, match=f"belongs to another model .* of another {what}"):
        begun(model_of(SCENE)).mj_step(mujoco.MjData(other))


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
    ids=[
        "compiled again",
        "copied model",
        "copied data",
        "deep copy",
        "pickled data",
        "pickled model",
    ],
)
def test_data_of_a_copied_model_is_accepted(make) -> None:
    model = model_of(SCENE)
    begun(model).mj_step(make(model))


def test_a_model_may_be_changed_in_place() -> None:
    """As domain randomisation does; data of a copy that was taken once is taken on."""
    model = model_of(SCENE)
    ripples = begun(model)
    for data in (mujoco.MjData(model), mujoco.MjData(copy.copy(model))):
        ripples.step(data)
        model.body_mass[1] *= 1.1
        ripples.step(data)
        model.body_mass[1] /= 1.1


@pytest.fixture(scope="module")
def coupled() -> CoupledModel:
    """A mesh with a flex collider, and a ball, a plane and an SDF geom beside it."""
    spec = mesh_spec(peanut(0.06), "free", contype=2, conaffinity=5, solref=[0.03, 1.0])
    add_ball(spec, "ball", [0, 0, 2], contype=1, conaffinity=0, solref=[0.01, 1.0])
    add_ball(spec, "", [0, 0, 3], contype=0, conaffinity=0)
    add_ball(
        spec,
        "pebble",
        [0, 0, 4],
        type=mujoco.mjtGeom.mjGEOM_SDF,
        meshname="shape",
        contype=8,
        conaffinity=8,
    )
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], contype=2, conaffinity=2
    )
    return CoupledModel(spec.compile())


def numbers(coupled: CoupledModel, *names: str) -> list[int]:
    return [coupled.names.index(name) for name in names]


def test_a_flex_collider_stands_for_its_geom(coupled: CoupledModel) -> None:
    [target] = numbers(coupled, "target")
    assert coupled.flex_colliders == {target: 0}
    np.testing.assert_array_equal(np.flatnonzero(coupled.has_flex), [target])
    np.testing.assert_allclose(coupled.solref[target], [0.03, 1.0])
    assert (
        coupled.collider_extents[target]
        == coupling.flex_thickness(coupled.model, 0)
        < coupled.extents[target]
    )
    # the geom's own masks are 0 now
    assert np.flatnonzero(coupled.can_collide(target)).tolist() == sorted(
        numbers(coupled, "ball", "floor")
    )


def test_geoms_collide_if_either_mask_allows_it_and_never_on_one_body(
    coupled: CoupledModel,
) -> None:
    ball, pebble = numbers(coupled, "ball", "pebble")
    assert np.flatnonzero(coupled.can_collide(ball)).tolist() == numbers(coupled, "target")
    assert coupled.model.geom_contype[pebble] & coupled.model.geom_conaffinity[pebble]
    assert not coupled.can_collide(pebble).any()


def test_a_flex_of_another_name_body_or_kind_is_no_collider() -> None:
    V, F = peanut(0.06)
    mesh = {"vert": V.ravel(), "elem": F.ravel()}
    spec = mesh_spec((V, F), route=None)
    spec.worldbody.add_body(name="elsewhere")
    spec.add_flex(name="other", dim=2, vertbody=["base"], **mesh)
    assert coupling.find_flex_colliders(spec.compile()) == {}
    for body, geom in (("base", {0: 1}), ("elsewhere", {})):
        changed = spec.copy()
        changed.add_flex(name="target", dim=2, vertbody=[body], **mesh)
        assert coupling.find_flex_colliders(changed.compile()) == geom
