"""Each kind of wrong input raises its own kind of error, which says value and remedy in one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import Material, Mesh, WaveSolver, build_atlas, load_mesh, sphere_atlas
from ripple_sim.solver.errors import AtlasError, MeshError, RippleError, SolverError

OPEN = np.eye(3), np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    ("call", "error", "value"),
    [
        (lambda: build_atlas(Mesh.from_arrays(*OPEN), layout="cube"), MeshError, "boundary edges"),
        (lambda: sphere_atlas(1.0, -3), AtlasError, "-3"),
        (lambda: load_mesh(Path("none.obj")), MeshError, "none.obj"),
        (lambda: WaveSolver(sphere_atlas(1.0, 8), Material(speed=-2.0), backend="cpu"), SolverError, "-2"),
        (lambda: WaveSolver(sphere_atlas(1.0, 8), 2.0, backend="cpu"), SolverError, "2.0"),
    ],
    ids=["open mesh", "resolution", "missing file", "speed", "material"],
)
def test_wrong_input_raises_the_error_of_its_kind(call: Callable, error: type[RippleError], value: str) -> None:
    with pytest.raises(RippleError) as caught:
        call()
    assert type(caught.value) is error
    assert value in str(caught.value)
    assert "\n" not in str(caught.value)
