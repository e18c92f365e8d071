"""GLSL sources: found below their package, with includes and defines put in.

What Python and GLSL agree on: the driver lays structs out as NumPy does.
"""

import sys
from enum import IntEnum
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import load_shader, shared_context
from ripple_sim.solver.gl.shader import Struct, numbered


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a package with shaders in two folders."""
    (tmp_path / "some_shaders" / "shared").mkdir(parents=True)
    (tmp_path / "some_shaders" / "passes").mkdir()
    (tmp_path / "some_shaders" / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "some_shaders", raising=False)
    files = {
        "passes/one.glsl": '#version 430\n#include "shared/outer.glsl"\n#include "shared/inner.glsl"\nvoid main() {}\n',
        "shared/outer.glsl": '#include "shared/inner.glsl"\n// outer\n',
        "shared/inner.glsl": "// inner\n",
        "passes/lost.glsl": '#version 430\n#include "shared/none.glsl"\n',
        "passes/bare.glsl": "void main() {}\n",
    }
    for path, text in files.items():
        (tmp_path / "some_shaders" / path).write_text(text)
    return "some_shaders"


def test_includes_are_put_in_once_and_defines_at_the_top(package: str) -> None:
    text = load_shader(package, "passes/one", N=8, HALF=0.5)
    assert text == "#version 430\n#define N 8\n#define HALF 0.5\n// inner\n\n// outer\n\n\nvoid main() {}\n"


def test_a_missing_file_is_named(package: str) -> None:
    with pytest.raises(GLError, match=r"some_shaders has no shader shared/none\.glsl"):
        load_shader(package, "passes/lost")
    with pytest.raises(GLError, match=r"has no shader passes/two\.glsl"):
        load_shader(package, "passes/two")


def test_a_shader_starts_with_its_version(package: str) -> None:
    with pytest.raises(GLError, match="must start with #version"):
        load_shader(package, "passes/bare")


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
def test_structs_are_laid_out_as_by_the_driver(opengl: None, layout: str) -> None:
    rows = np.zeros(2, OUTER.dtype)
    values = np.arange(1, rows.nbytes // 4 + 1, dtype=np.float32)
    rows.view(np.float32)[...] = values
    rows["rotation"][..., 3] = 0.0
    with shared_context() as ctx:
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


def test_arrays_and_nested_structs_are_declared() -> None:
    assert OUTER.members.startswith("vec4 first; vec4 many[3]; mat3 rotation; Inner inner[2];")
    assert INNER.defines() == {"INNER_MEMBERS": "vec4 direction; mat4 planes;"}
    assert OUTER.dtype["inner"].shape == (2,)


def test_numbered_names_get_a_suffix() -> None:
    class Unit(IntEnum):
        SHADOW = 1
        SKY = 4

    assert numbered(Unit, "_UNIT") == {"SHADOW_UNIT": 1, "SKY_UNIT": 4}
