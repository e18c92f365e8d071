"""Backends by name."""

import numpy as np
import pytest
from hand_made import square

from ripple_sim.solver import GLError, Material, SolverError, texel_atlas
from ripple_sim.solver.backends.backend import auto_backend, make_backend
from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator


@pytest.fixture
def operator() -> WaveOperator:
    return build_operator(texel_atlas(square(4)), Material(speed=1.0), "fem")


@pytest.mark.parametrize("name", ["cuda", "", "CPU"])
def test_an_unknown_backend_is_named_beside_the_valid_ones(operator: WaveOperator, name: str) -> None:
    with pytest.raises(SolverError, match=f"backend '{name}' does not exist; valid are 'auto', 'gl', 'cpu'"):
        make_backend(name, operator)


@pytest.mark.parametrize(("software", "chosen"), [(True, "cpu"), (False, "gl")])
def test_auto_takes_gl_on_hardware_only(
    opengl: None, operator: WaveOperator, monkeypatch: pytest.MonkeyPatch, software: bool, chosen: str
) -> None:
    monkeypatch.setattr(GLContext, "software", software)
    assert auto_backend() == chosen
    assert make_backend("auto", operator).name == chosen


def test_without_opengl_auto_takes_the_cpu_and_gl_is_an_error(
    operator: WaveOperator, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(device: int | None) -> None:
        raise GLError("no OpenGL 4.3 context")

    monkeypatch.setattr("ripple_sim.solver.gl.context.create_context", fail)
    monkeypatch.setattr("ripple_sim.solver.gl.context._shared", {})
    assert make_backend("auto", operator).name == "cpu"
    with pytest.raises(GLError, match=r"no OpenGL 4\.3"):
        make_backend("gl", operator)


def test_a_new_backend_is_at_rest_and_stays_there(operator: WaveOperator, backend: str) -> None:
    waves = make_backend(backend, operator)
    assert waves.name == backend
    waves.advance(3, 0.01)
    waves.wait()
    assert waves.finite()
    for field in (waves.height(), waves.velocity(), waves.dent()):
        assert field.dtype == np.float32 and field.shape == (1, 4, 4) and not field.any()
