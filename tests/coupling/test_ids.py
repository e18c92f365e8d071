"""The numberings of geoms, flexes, skins, targets and colliders."""

import mujoco
import pytest

from ripple_sim.coupling import CoupledModel, find_target, is_geom, target_of_flex
from ripple_sim.coupling.ids import flex_of, skin_of, target_of_skin

MODEL = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="bone"><geom name="ball" size="0.1"/></body>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" pos="0 0 1"/>
    <flexcomp name="flag" type="grid" count="2 2 1" spacing="0.1 0.1 0.1" pos="0 0 2"/>
  </worldbody>
  <deformable>
    <skin name="cover" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 2 1 0 1 3 0 3 2 1 2 3">
      <bone body="bone" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3"
        vertweight="1 1 1 1"/>
    </skin>
  </deformable>
</mujoco>
"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MODEL)


def test_targets_follow_the_geoms_and_the_vertices_of_flexes(model: mujoco.MjModel) -> None:
    targets = [find_target(model, name) for name in ("ball", "cloth", "flag", "cover")]
    first_flex = model.ngeom + 9 + 4
    assert targets == [1, first_flex, first_flex + 1, first_flex + 2]
    assert [is_geom(target, model) for target in targets] == [True, False, False, False]
    assert [flex_of(model, target) for target in targets] == [-1, 0, 1, -1]
    assert [skin_of(model, target) for target in targets] == [-1, -1, -1, 0]
    assert target_of_flex(model, 1) == targets[2]
    assert target_of_skin(model, 0) == targets[3]


def test_every_collider_id_leads_to_its_geom_flex_or_skin(
    model: mujoco.MjModel,
) -> None:
    coupled = CoupledModel(model)
    owners = [coupled.names[owner] for owner in coupled.owners]
    vertices = ["cloth"] * 9 + ["flag"] * 4
    assert owners == ["floor", "ball", *vertices, "cloth", "flag", "cover"]
