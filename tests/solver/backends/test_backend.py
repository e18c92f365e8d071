"""Backends by name."""

from pathlib import Path

import numpy as np
import pytest
from hand_made import square

from ripple_sim.solver import GLError, Material, SolverError, texel_atlas
from ripple_sim.solver.backends import backend
from ripple_sim.solver.backends.backend import auto_backend, make_backend
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator


@pytest.fixture
def operator() -> WaveOperator:
    return build_operator(texel_atlas(square(4)), Material(speed=1.0), "fem")


@pytest.mark.parametrize("name", ["cuda", "", "CPU"])
def test_an_unknown_backend_is_named_beside_the_valid_ones(operator: WaveOperator, name: str) -> None:
    with pytest.raises(SolverError, match=f"backend '{name}' does not exist; valid are 'auto', 'gl', 'cpu'"):
        make_backend(name, operator)


def test_auto_takes_the_cpu_where_opengl_is_software(opengl: None, operator: WaveOperator) -> None:
    assert auto_backend() == "cpu"
    assert make_backend("auto", operator).name == "cpu"


@pytest.fixture
def hardware(opengl: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> GLContext:
    """The software driver, taken for hardware of which nothing is known."""
    monkeypatch.setattr(GLContext, "software", False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(backend, "_SIZES", (8, 24))
    backend.measured.cache_clear()
    yield shared_context()
    backend.measured.cache_clear()


def test_auto_takes_what_was_measured_to_be_faster(
    hardware: GLContext, operator: WaveOperator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A GPU that takes 1 ms for any number of texels, a processor that takes 1 ms for 4,000."""
    known = backend.Measured((1000.0, 8000.0), (1e-3, 1e-3), (0.25e-3, 2e-3))
    monkeypatch.setattr(backend, "measure", lambda gl: known)
    assert [auto_backend(texels) for texels in (16, 3900, 4100, 10**6)] == ["cpu", "cpu", "gl", "gl"]
    assert make_backend("auto", operator).name == "cpu"
    assert str(known) == "1,000 texels: 1.00 ms GL, 0.25 ms CPU; 8,000 texels: 1.00 ms GL, 2.00 ms CPU"


def test_a_machine_is_measured_once(hardware: GLContext, monkeypatch: pytest.MonkeyPatch) -> None:
    first = backend.measured(hardware)
    assert first.texels == (384.0, 3456.0)
    assert min(first.gl + first.cpu) > 0
    backend.measured.cache_clear()  # as another process does
    monkeypatch.setattr(backend, "measure", lambda gl: pytest.fail("measured twice"))
    assert backend.measured(hardware) == first
    assert auto_backend(10**6) == first.faster(10**6)


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
