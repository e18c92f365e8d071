"""The renderer's contract with its shaders: nothing stands twice, every shader keeps to it, and so does the driver."""

import re
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.render.contract import DEFINES, FRAME, LEVELS, Binding, Struct, Unit, numbered
from ripple_sim.render.resources import Resources
from ripple_sim.render.visuals.lights import SOFT_BOX_LIGHTS

RENDER = Path(__file__).parents[2] / "ripple_sim" / "render"


def test_no_number_binds_anything_but_in_the_contract() -> None:
    for path in RENDER.rglob("*.glsl"):
        assert not re.search(r"binding\s*=\s*\d", path.read_text()), path
    for path in RENDER.rglob("*.py"):
        assert not re.search(r"\.use\(\d|bind_to_\w+\(\d", path.read_text()), path


def test_every_unit_and_binding_is_used_by_a_shader() -> None:
    sources = "".join(path.read_text() for path in RENDER.rglob("*.glsl"))
    names = [*numbered(Unit, "_UNIT"), *numbered(Binding, "_BINDING")]
    assert [name for name in names if name not in sources] == []
    assert len(set(Unit)) == len(Unit.__members__)  # every unit is its own; what is bound at other times may share
    assert max(Binding) < 8


def test_the_frame_block_is_as_large_as_its_values(gl) -> None:
    class Owner:
        pass

    owner = Owner()
    resources = Resources(gl, owner)
    program = resources.program("passes/classify", SKYBOX=0, SAMPLES=1, LAYER=0, SHADOWS=1, NEAR_LIGHTS=0, TILES=0)
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


INNER = Struct("Inner", direction="vec4", planes="mat4")
OUTER = Struct("Outer", first="vec4", many=("vec4", 3), rotation="mat3", inner=(INNER, 2), matrix="mat4", last="vec4")

COPY = f"""#version 430
layout(local_size_x = 1) in;
struct Inner {{ {INNER.members} }};
struct Outer {{ {OUTER.members} }};
%s
layout(std430, binding = 1) writeonly buffer Result {{ vec4 result[]; }};

void main()
{{
    int k = 0;
    for (int row = 0; row < 2; ++row) {{
        Outer o = outer[row];
        result[k++] = o.first;
        for (int i = 0; i < 3; ++i) result[k++] = o.many[i];
        for (int i = 0; i < 3; ++i) result[k++] = vec4(o.rotation[i], 0.0);
        for (int j = 0; j < 2; ++j) {{
            result[k++] = o.inner[j].direction;
            for (int i = 0; i < 4; ++i) result[k++] = o.inner[j].planes[i];
        }}
        for (int i = 0; i < 4; ++i) result[k++] = o.matrix[i];
        result[k++] = o.last;
    }}
}}
"""
BLOCKS = {
    "std140": "layout(std140, binding = 0) uniform Rows { Outer outer[2]; };",
    "std430": "layout(std430, binding = 0) readonly buffer Rows { Outer outer[]; };",
}


@pytest.mark.parametrize("layout", BLOCKS)
def test_structs_are_laid_out_as_by_the_driver(gl, layout: str) -> None:
    rows = np.zeros(2, OUTER.dtype)
    values = np.arange(1, rows.nbytes // 4 + 1, dtype=np.float32)
    rows.view(np.float32)[...] = values
    rows["rotation"][..., 3] = 0.0
    with gl as ctx:
        shader = ctx.compute_shader(COPY % BLOCKS[layout])
        given, result = ctx.buffer(rows.tobytes()), ctx.buffer(reserve=rows.nbytes)
        if layout == "std140":
            given.bind_to_uniform_block(0)
        else:
            given.bind_to_storage_buffer(0)
        result.bind_to_storage_buffer(1)
        shader.run()
        ctx.finish()
        np.testing.assert_array_equal(np.frombuffer(result.read(), np.float32), rows.view(np.float32))
