import sys

import pytest

from ripple_sim.solver.gl import context, shared_context

_SHADER = """#version 430
layout(local_size_x = 1) in;
uniform float factor = 3.0;
uniform float more;
layout(std430, binding = 0) buffer Values { float values[]; };
void main() { values[0] = factor * values[0] + more; }
"""


@pytest.mark.usefixtures("opengl")
def test_a_program_is_used_again_with_the_uniforms_that_it_began_with(tmp_path, monkeypatch):
    (tmp_path / "pooled_shaders").mkdir()
    (tmp_path / "pooled_shaders" / "__init__.py").touch()
    (tmp_path / "pooled_shaders" / "scale.glsl").write_text(_SHADER)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "pooled_shaders", raising=False)
    gl = shared_context()
    first = gl.compute_shader("pooled_shaders", "scale")
    other = gl.compute_shader("pooled_shaders", "scale")
    assert other is not first  # two at a time have uniforms of their own
    with gl:
        first["factor"], first["more"] = 5.0, 1.0
    gl.release(first)
    again = gl.compute_shader("pooled_shaders", "scale")
    assert again is first
    with gl:
        assert (again["factor"].value, again["more"].value) == (3.0, 0.0)


class Compiled:
    """A program without uniforms."""

    def __init__(self, number: int) -> None:
        self.glo = number

    def __iter__(self):
        return iter(())


def test_a_full_pool_lets_go_of_what_has_been_idle_for_longest(monkeypatch):
    """It refused what came later, so that what was used now was compiled each time."""
    monkeypatch.setattr(context, "_MOST", 2)
    pool, programs = context.ProgramPool(), [Compiled(number) for number in range(4)]
    new = Compiled(4)
    for program in programs[:3]:
        assert pool.take((f"source {program.glo}",), lambda program=program: program) is program
    assert [pool.give_back(program) for program in programs] == [None, None, programs[0], programs[3]]
    assert pool.take(("source 0",), lambda: new) is new
    for program in programs[2:0:-1]:
        assert pool.take((f"source {program.glo}",), lambda: pytest.fail("compiled again")) is program
