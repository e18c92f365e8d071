"""Surfaces, and a folder for MuJoCo's log of warnings, that tests of several rooms share."""

from pathlib import Path

import pytest
import trimesh

from ripple_sim.solver import Atlas, Mesh, build_atlas


@pytest.fixture(scope="session")
def block() -> Atlas:
    """A cube of 1 m, cut into triangles."""
    solid = trimesh.creation.box(extents=(1, 1, 1)).subdivide_to_size(0.2)
    return build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)


@pytest.fixture
def in_tmp_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes a log of what goes wrong into the present folder."""
    monkeypatch.chdir(tmp_path)
