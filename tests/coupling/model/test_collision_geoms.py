"""Which geoms collide for a target: those it names, itself, or those of its body."""

import mujoco
import numpy as np
import pytest
from mujoco_models import model_of

from ripple_sim import Material, RippleError, Ripples
from ripple_sim.coupling.geoms import find_geom, named_collision_geoms
from ripple_sim.coupling.model import CoupledModel

SEEN = 'contype="0" conaffinity="0"'
ROBOT = f"""<geom name="floor" type="plane" size="1 1 1"/>
<geom name="statue" size="0.5" pos="3 0 0.5" {SEEN}/><geom name="core" size="0.4" pos="3 0 0.5"/>
<geom name="wall" type="box" size="0.1 2 2" pos="-3 0 0"/>
<body name="link" pos="0 0 1"><freejoint/>
  <geom name="shell" size="0.2" {SEEN}/><geom name="cap" size="0.2" pos="0 0 0.2" {SEEN}/>
  <geom name="hull0" size="0.19"/><geom name="hull1" size="0.1"/>
  <body name="tool"><geom name="blade" size="0.1" {SEEN}/>
    <body name="guard"><geom name="guard" size="0.05"/></body></body>
  <body name="finger"><joint/><geom name="nail" size="0.1" {SEEN}/><geom name="pad" size="0.1"/></body>
</body>"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return model_of(ROBOT)


def colliders(model: mujoco.MjModel, targets: tuple[str, ...], **contacts: list[str]) -> list[list[str]]:
    ids = [find_geom(model, name) for name in targets]
    coupled = CoupledModel(model, ids, named_collision_geoms(model, targets, contacts))
    return [[coupled.names[geom] for geom in coupled.collision_geoms(target)] for target in ids]


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
        # its body has none: those of bodies welded to it, which do not include the finger's
        (("blade",), {}, [["hull0", "hull1", "guard"]]),
        (("nail",), {}, [["pad"]]),
        # geoms of the world need not belong together
        (("statue",), {}, [["core"]]),
        (("wall",), {}, [["wall"]]),
    ],
)
def test_colliders_of_targets(model, targets, contacts, expected) -> None:
    assert colliders(model, targets, **contacts) == expected


def test_a_pair_collides_whatever_its_masks_say() -> None:
    seen = f'<body name="a"><freejoint/><geom name="a" size="0.1" {SEEN}/></body>'
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody>{seen}<geom name="b" size="0.1" {SEEN}/><geom name="c" size="0.1" {SEEN}/></worldbody>
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
        ({"shell": ["pad"]}, "names geom 'pad' on body 'finger', which moves by itself; valid are .* body 'link'"),
        ({"shell": ["cap"]}, "names geom 'cap', which ripples itself"),
        ({"shell": ["hull2"]}, "no geom 'hull2'; its geoms are"),
        (
            {"blade": ["guard"]},
            "geom 'blade', which does not ripple; the rippling geoms are 'shell', 'cap'",
        ),
        ({"shell": "hull0"}, "contacts of geom 'shell' is 'hull0'; valid is a list"),
        ({"shell": 3}, "contacts of geom 'shell' is 3; valid is a list"),
        ({"shell": ["hull0"], 4: []}, "contacts has two entries for geom 'shell'"),
        (["shell"], r"contacts is \['shell'\]; valid is a mapping"),
    ],
)
def test_contacts_that_cannot_be_are_named(model, contacts, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        Ripples(model, {"shell": Material(), "cap": Material()}, contacts=contacts, resolution=8, backend="cpu")
