"""What is refused: open, non-manifold, several parts, handles."""

import numpy as np
import pytest
from solids import cube, torus

from ripple_sim.solver import Mesh, MeshError


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        (lambda V, F: (V, F[1:]), "open: 3 boundary edges"),
        (lambda V, F: (np.vstack([V, V + 3]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (np.vstack([V, [[5, 5, 5]]]), np.vstack([F, [[0, 1, 8]]])), "non-manifold"),
        (lambda V, F: (np.where(np.arange(8)[:, None] == 2, np.nan, V), F), "NaN"),
        (lambda V, F: (V * [1, 1, 0], F), "."),
        (lambda V, F: (V, F + 1), "indices run from"),
        (lambda V, F: (V, F[:2]), "open: 4 boundary edges round 1 hole"),
        (lambda V, F: (V, F[:1]), "open: 3 boundary edges"),
        (lambda V, F: (V, F[:1, [0, 1, 1]]), "three different corners"),
        (lambda V, F: (V * 1e15, F), "size is 1e"),
        (lambda V, F: (V, F * 1.5), "integers"),
    ],
)
def test_defects_are_refused_by_name(damage, name: str) -> None:
    with pytest.raises(MeshError, match=name):
        Mesh.from_arrays(*damage(*cube()))


def test_genus_is_named() -> None:
    with pytest.raises(MeshError, match="genus 1"):
        Mesh.from_arrays(*torus())


def test_two_cubes_sharing_a_corner_are_non_manifold() -> None:
    V, F = cube()
    with pytest.raises(MeshError, match=r"separate parts|touches itself"):
        Mesh.from_arrays(np.vstack([V, V + 1]), np.vstack([F, F + 8]))
