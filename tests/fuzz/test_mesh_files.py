"""Mesh files of any content load, or raise our error; what loads is finite and has triangles."""

import numpy as np
import pytest
import trimesh
from fuzzing import CHANGES, changed, fuzzed, outcome
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ripple_sim.solver import Mesh, MeshError, load_mesh

BALL = trimesh.creation.icosphere(subdivisions=1)
FILES = {
    kind: data if isinstance(data := BALL.export(file_type=kind), bytes) else data.encode()
    for kind in ("obj", "off", "ply", "stl", "glb")
}


def check(found: object) -> None:
    assert isinstance(found, Mesh) or (isinstance(found, MeshError) and "\n" not in str(found))
    if isinstance(found, Mesh):
        assert np.isfinite(found.V).all()
        assert len(found.F) > 0


@fuzzed
@given(st.sampled_from(sorted(FILES)), CHANGES, st.floats(0.2, 1))
def test_a_file_with_any_bytes_anywhere_and_any_end(
    tmp_path_factory: pytest.TempPathFactory, kind: str, changes: list, part: float
) -> None:
    content = changed(FILES[kind], changes)
    path = tmp_path_factory.getbasetemp() / f"fuzzed.{kind}"
    path.write_bytes(content[: int(part * len(content))])
    check(outcome(lambda: load_mesh(path)))


@fuzzed
@given(
    hnp.arrays(np.float64, st.tuples(st.integers(0, 8), st.just(3)), elements=st.floats(width=64)),
    hnp.arrays(np.int64, st.tuples(st.integers(0, 12), st.just(3)), elements=st.integers(-2, 9)),
)
def test_any_arrays(V: np.ndarray, F: np.ndarray) -> None:
    check(outcome(lambda: Mesh.from_arrays(V, F)))
