"""Repair on request, by pymeshfix."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from solids import BALL, is_closed_sphere

from ripple_sim.solver import Mesh, MeshError
from ripple_sim.solver.mesh.repair import repaired


class TestRepair:
    """Mending with pymeshfix, which not everybody has."""

    @pytest.fixture(autouse=True)
    def _pymeshfix(self) -> None:
        pytest.importorskip("pymeshfix")

    @pytest.mark.parametrize("name", ["open", "non-manifold", "self-touching", "NaN", "two parts"])
    def test_a_damaged_ball_becomes_a_ball(self, name: str) -> None:
        V, F = np.array(BALL.vertices), np.array(BALL.faces)
        if name == "open":
            F = F[6:]
        elif name == "non-manifold":
            V, F = np.vstack([V, [[2.0, 0, 0]]]), np.vstack([F, [[F[0, 0], F[0, 1], len(V)]]])
        elif name == "self-touching":
            V[np.linalg.norm(V - V[0], axis=1).argmax()] = V[0]
        elif name == "NaN":
            V[3] = np.nan
        else:
            V, F = np.vstack([V, 0.1 * V + 5]), np.vstack([F, F + len(V)])
        with pytest.raises(MeshError) as refused:
            Mesh.from_arrays(V, F)
        mesh = repaired(V, F, "ball", refused.value)
        assert is_closed_sphere(mesh)
        assert mesh.volume == pytest.approx(BALL.volume, rel=0.4)
        assert mesh.fixes[0].startswith("repaired by pymeshfix")
        again = repaired(V, F, "ball", refused.value)
        np.testing.assert_array_equal(mesh.V, again.V)
        np.testing.assert_array_equal(mesh.F, again.F)

    def test_handles_stay_and_are_named(self) -> None:
        torus = trimesh.creation.torus(1.0, 0.3)
        with pytest.raises(MeshError, match=r"genus 1.*pymeshfix cannot"):
            repaired(np.array(torus.vertices), np.array(torus.faces), "ring", MeshError("ring is of genus 1"))

    def test_a_crash_of_pymeshfix_is_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # the program that runs it is replaced by one that kills itself
        real = subprocess.run
        suicide = [sys.executable, "-c", "import os; os.abort()"]
        monkeypatch.setattr(subprocess, "run", lambda program, **options: real(suicide, **options))
        with pytest.raises(MeshError, match=r"open; pymeshfix cannot repair that \(it failed\)$"):
            repaired(np.array(BALL.vertices), np.array(BALL.faces)[1:], "ball", MeshError("ball is open"))

    def test_what_is_hopeless_is_refused(self) -> None:
        with pytest.raises(MeshError, match="nothing is left"):
            repaired(np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "dust", MeshError("dust"))


def test_without_pymeshfix_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    with pytest.raises(MeshError, match=r"open.*pip install 'ripple-sim\[repair\]'"):
        repaired(np.array(BALL.vertices), np.array(BALL.faces)[1:], "ball", MeshError("ball is open"))
