"""What the cube layout refuses: open surfaces, several parts, handles, no volume."""

import numpy as np
import pytest
from solids import cube, torus

from ripple_sim.solver import Mesh, MeshError, build_atlas
from ripple_sim.solver.mesh.mesh import check_genus_zero


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda V, F: (V, F[1:]), r"open: 3 boundary edges round 1 hole \(one near \(.*repair"),
        (lambda V, F: (V, F[:2]), "open: 4 boundary edges round 1 hole"),
        (lambda V, F: (np.vstack([V, V + 3]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (np.vstack([V, [[5, 5, 5]]]), np.vstack([F, [[0, 1, 8]]])), "2 separate parts.*and open.*cut"),
        (lambda V, F: (np.vstack([V, V + 1]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (V * [1, 1, 0], F), "open|no volume"),
        (lambda V, F: torus(), "genus 1"),
    ],
)
def test_a_surface_that_the_cube_does_not_fit_is_refused_by_name(change, said: str) -> None:
    mesh = Mesh.from_arrays(*change(*cube()), name="thing.obj")
    with pytest.raises(MeshError, match=rf"^thing\.obj is .*{said}") as refused:
        build_atlas(mesh, 8, cache=False, layout="cube")
    assert "\n" not in str(refused.value)


def test_many_parts_are_advised_to_be_wrapped() -> None:
    V, F = cube()
    steps = np.arange(101)
    many = Mesh.from_arrays(
        (V + 3 * steps[:, None, None] * [1, 0, 0]).reshape(-1, 3), (F + 8 * steps[:, None, None]).reshape(-1, 3)
    )
    with pytest.raises(MeshError, match=r"101 separate parts.*--wrap"):
        check_genus_zero(many)


def test_a_closed_body_without_handles_passes() -> None:
    check_genus_zero(Mesh.from_arrays(*cube()))
