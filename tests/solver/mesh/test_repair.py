"""Repair on request, by pymeshfix."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from all_kinds import BALL
from known_meshes import known_mesh
from sound import assert_sound

from ripple_sim.solver import MeshError, load_mesh
from ripple_sim.solver.mesh import Soup, repaired


def located(places: np.ndarray, uv: np.ndarray) -> set[tuple[float, ...]]:
    """Corners of triangles with their texture coordinates."""
    return set(map(tuple, np.concatenate([places, uv], axis=-1).reshape(-1, 5).tolist()))


class TestRepair:
    """Mending with pymeshfix, which not everybody has."""

    @pytest.fixture(autouse=True)
    def _pymeshfix(self) -> None:
        pytest.importorskip("pymeshfix")

    @pytest.mark.parametrize("name", ["open", "NaN", "two parts", "ring"])
    def test_holes_are_closed_and_all_else_stays(self, name: str) -> None:
        V = np.array(BALL.vertices)
        F = np.array(BALL.faces)
        if name == "open":
            F = F[6:]
        elif name == "NaN":
            V[3] = np.nan
        elif name == "two parts":
            V, F = np.vstack([V, 0.1 * V + 5]), np.vstack([F[4:], F + len(V)])
        else:
            ring = trimesh.creation.torus(1.0, 0.3)
            V = np.array(ring.vertices)
            F = np.array(ring.faces)[3:]
        uv = np.random.default_rng(0).uniform(size=(len(F), 3, 2))
        mesh = repaired(Soup(V, F, uv), "ball")
        assert_sound(mesh)
        assert mesh.closed
        assert mesh.component_count == (2 if name == "two parts" else 1)
        assert mesh.genus[0] == (name == "ring")
        if name != "ring":
            assert mesh.volume == pytest.approx(
                BALL.volume * (1.001 if name == "two parts" else 1), rel=0.25
            )
        assert any(note.startswith("hole closed: ") for note in mesh.notes)
        finite = np.isfinite(V[F]).all(axis=(1, 2))
        assert mesh.corner_uv is not None
        assert located(V[F[finite]], uv[finite]) <= located(mesh.V[mesh.F], mesh.corner_uv)
        assert len(mesh.F) > finite.sum()
        again = repaired(Soup(V, F, uv), "ball")
        np.testing.assert_array_equal(mesh.V, again.V)
        np.testing.assert_array_equal(mesh.F, again.F)

    def test_the_teapot_keeps_its_spout_its_handle_and_its_lid(self) -> None:
        path = known_mesh("bad/several-parts-teapot.obj")
        before = load_mesh(path)
        mesh = load_mesh(path, repair=True)
        assert mesh.closed
        assert mesh.component_count == before.component_count == 4
        np.testing.assert_allclose(np.ptp(mesh.V, axis=0), np.ptp(before.V, axis=0))
        assert sum(note.startswith("hole closed: ") for note in mesh.notes) == 6

    def test_a_single_triangle_stays_open_with_a_note(self) -> None:
        mesh = repaired(Soup(np.eye(3), np.array([[0, 1, 2]])), "tile")
        assert not mesh.closed
        assert mesh.notes == ("1 rim left open, where a lid would lie on other triangles",)

    def test_a_crash_of_pymeshfix_is_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # the program that runs it is replaced by one that kills itself
        real = subprocess.run
        suicide = [sys.executable, "-c", "import os; os.abort()"]
        monkeypatch.setattr(subprocess, "run", lambda program, **options: real(suicide, **options))
        with pytest.raises(MeshError, match=r"ball: pymeshfix cannot repair it \(it failed\)$"):
            repaired(Soup(np.array(BALL.vertices), np.array(BALL.faces)[1:]), "ball")

    def test_meshes_beyond_repair_are_refused(self) -> None:
        with pytest.raises(MeshError, match="nothing is left"):
            repaired(Soup(np.full((3, 3), np.nan), np.array([[0, 1, 2]])), "dust")


def test_the_error_without_pymeshfix_names_the_package_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    with pytest.raises(MeshError, match=r"open.*pip install 'ripple-sim\[repair\]'"):
        repaired(Soup(np.array(BALL.vertices), np.array(BALL.faces)[1:]), "ball")


def test_a_closed_surface_needs_no_repair(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    assert repaired(Soup(np.array(BALL.vertices), np.array(BALL.faces)), "ball").notes == ()
