"""Figures of merit of a sphere map, where they are known."""

import numpy as np
import pytest
from genus_zero import TETRAHEDRON, icosphere

from ripple_sim.solver import Mesh
from ripple_sim.solver.layouts.cube.atlas import sphere_map_quality
from ripple_sim.solver.texels.topology import QUANTILES


def unit(V: np.ndarray) -> np.ndarray:
    return V / np.linalg.norm(V, axis=1, keepdims=True)


def test_a_regular_solid_is_spread_evenly() -> None:
    V, F = TETRAHEDRON
    quality = sphere_map_quality(Mesh(V, F), unit(V))
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi)
    assert quality["starved"] == 0
    for name in QUANTILES:
        assert quality[name] == pytest.approx(1)


def test_a_map_inside_out_has_every_triangle_flipped() -> None:
    V, F = icosphere(1)
    quality = sphere_map_quality(Mesh(V, F), -V)
    assert quality["flipped"] == len(F)
    assert quality["solid_angle"] == pytest.approx(-4 * np.pi)


@pytest.mark.parametrize(("subdivisions", "starved"), [(0, 0.0), (2, 1.0)])
def test_a_needle_is_starved_when_its_triangles_have_too_small_a_share_of_the_sphere(
    subdivisions: int, starved: float
) -> None:
    # five triangles hold all the area: of 20 their stretch is 2, of 320 it is 8
    sphere, F = icosphere(subdivisions)
    V = sphere.copy()
    V[0] *= 1e5
    assert (F == 0).sum() == 5
    quality = sphere_map_quality(Mesh(V, F), sphere)
    assert quality["starved"] == pytest.approx(starved, abs=1e-3)
    assert quality["q50"] == pytest.approx({0: 2, 2: 8}[subdivisions], rel=0.15)


def test_quality_does_not_know_size_and_place() -> None:
    sphere, F = icosphere(2)
    V = sphere * [1, 2, 0.5]
    here, there = (sphere_map_quality(Mesh(points, F), sphere) for points in (V, 1e4 * V + [5, 6, 7]))
    assert here == pytest.approx(there)
    values = [here[name] for name in QUANTILES]
    assert values == sorted(values) and values[0] < values[-1]
