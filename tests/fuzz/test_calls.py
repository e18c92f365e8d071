"""Calls and commands with any arguments work, raise our error, or exit with 0 or 2."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from fuzzing import NUMBERS, TEXTS, VALUES, command, fuzzed, outcome
from hypothesis import given, strategies as st

from ripple_sim.cli import COMMANDS
from ripple_sim.solver import Material, WaveSolver, build_atlas, load_atlas, load_mesh, sphere_atlas

ATLAS = sphere_atlas(resolution=4)
MAKERS: dict[str, Callable[..., Any]] = {
    "material": lambda a, b, c: Material(speed=a, damping=b, density=c),
    "stiff material": lambda a, b, c: Material(stiffness=a, viscosity=b, bending=c),
    "membrane": Material.membrane,
    "suited": lambda a, b, c: Material.suited(a, b, radius=c),
    "solver": lambda a, b, c: WaveSolver(ATLAS, a, operator=b, rim=c, backend="cpu"),
    "atlas": lambda a, b, c: build_atlas(a, resolution=b, layout=c, cache=False),
    "sphere": lambda a, b, c: sphere_atlas(radius=a, resolution=4),
    "places": lambda a, b, c: ATLAS.locate(a),
    "stiffness": lambda a, b, c: ATLAS.stiffness(a),
    "mesh file": lambda a, b, c: load_mesh(a),
    "atlas file": lambda a, b, c: load_atlas(a),
}
ACTIONS: dict[str, Callable[..., Any]] = {
    "impulse": WaveSolver.add_impulse,
    "force": WaveSolver.add_force,
    "pressure": lambda waves, a, b, c: waves.add_pressure(a),
    "height": lambda waves, a, b, c: setattr(waves, "height", a),
    "velocity": lambda waves, a, b, c: waves.add_velocity(a),
    "substeps": lambda waves, a, b, c: waves.step(0.01, substeps=a),
}
POINTS = st.just([1.0, 0.0, 0.0]) | VALUES


@fuzzed
@given(st.sampled_from(sorted(MAKERS)), VALUES, VALUES, VALUES)
def test_constructors_with_any_arguments(name: str, a: Any, b: Any, c: Any) -> None:
    with np.errstate(all="ignore"):
        outcome(lambda: MAKERS[name](a, b, c))


@fuzzed
@given(st.sampled_from(sorted(ACTIONS)), POINTS, VALUES, VALUES, st.floats(0, 0.05))
def test_methods_of_waves_with_any_arguments(name: str, a: Any, b: Any, c: Any, dt: float) -> None:
    waves = WaveSolver(ATLAS, backend="cpu")
    with np.errstate(all="ignore"):
        calls = (
            lambda: ACTIONS[name](waves, a, b, c),
            lambda: waves.step(dt),
            lambda: waves.height,
        )
        results = [outcome(call) for call in calls]
    if not any(isinstance(result, Exception) for result in results):
        assert np.isfinite(waves.height).all()


OPTIONS = [
    *(
        "-o",
        "--output",
        "--size",
        "--fps",
        "--duration",
        "--resolution",
        "--seed",
        "--backend",
        "--layout",
    ),
    *(
        "--overlay",
        "--overwrite",
        "--resume",
        "--port",
        "--host",
        "--json",
        "--help",
        "--up",
        "--bodies",
    ),
    *("--shutter", "--", "-", "-x"),
]
WORDS = st.one_of(
    st.sampled_from(OPTIONS), NUMBERS.map(lambda value: str(value)[:300]), TEXTS, st.just("sphere")
)


@pytest.fixture(autouse=True, scope="module")
def _nothing_runs():
    with pytest.MonkeyPatch.context() as patch:
        for each in {*COMMANDS.values()}:
            if hasattr(each, "run"):
                patch.setattr(each, "run", lambda self: None)
        yield


@fuzzed
@given(st.sampled_from([*COMMANDS, "", "rendr"]), st.lists(WORDS, max_size=6))
def test_any_arguments_of_the_program(name: str, words: list[str]) -> None:
    assert command(name, *words) in (0, 2)
