"""The renderer's contract with its shaders: nothing stands twice, and every shader keeps to it."""

import re
from pathlib import Path

import numpy as np

from ripple_sim.render.contract import DEFINES, FRAME, LEVELS, Binding, Unit
from ripple_sim.render.resources import Resources
from ripple_sim.render.visuals.lights import SOFT_BOX_LIGHTS

RENDER = Path(__file__).parents[3] / "ripple_sim" / "render"


def test_no_number_binds_anything_but_in_the_contract() -> None:
    for path in RENDER.rglob("*.glsl"):
        assert not re.search(r"binding\s*=\s*\d", path.read_text()), path
    for path in RENDER.rglob("*.py"):
        assert not re.search(r"\.use\(\d|bind_to_\w+\(\d", path.read_text()), path


def test_every_unit_and_binding_is_used_by_a_shader() -> None:
    sources = "".join(path.read_text() for path in RENDER.rglob("*.glsl"))
    names = [f"{unit.name}_UNIT" for unit in Unit] + [f"{binding.name}_BINDING" for binding in Binding]
    assert [name for name in names if name not in sources] == []
    assert len(set(names)) == len(Unit.__members__) + len(Binding.__members__)  # aliases would be lost


def test_the_frame_block_is_as_large_as_its_values(gl) -> None:
    class Owner:
        pass

    owner = Owner()
    resources = Resources(gl, owner)
    program = resources.program(
        "glsl/view_vertex", "passes/classify_fragment", SKYBOX=0, SAMPLES=1, LAYER=0, SHADOWS=1, NEAR_LIGHTS=0
    )
    assert program["Frame"].size == FRAME.dtype.itemsize
    resources.release()


def test_levels_are_exact_in_every_depth_buffer() -> None:
    for level in LEVELS.values():
        assert level * 2**16 % 1 == 0
    assert sorted(LEVELS.values(), reverse=True) == list(LEVELS.values())


def test_there_are_as_many_soft_boxes_as_the_block_holds() -> None:
    assert len(SOFT_BOX_LIGHTS) == DEFINES["SOFT_BOXES"]
    assert FRAME.dtype["soft_box_normal"].shape == (len(SOFT_BOX_LIGHTS), 4)
    assert np.isfinite(np.array([box[:4] for box in SOFT_BOX_LIGHTS])).all()
