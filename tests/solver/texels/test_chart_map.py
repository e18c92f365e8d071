"""Texture coordinates of an atlas: values carried to the cut triangles, and places in layers with a halo."""

import numpy as np
import pytest
from genus_zero import icosphere
from hand_made import square, two_squares

from ripple_sim.solver import Mesh, texel_atlas
from ripple_sim.solver.layouts.cube.atlas import CubeChartMap
from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.chart_map import texture_coordinates
from ripple_sim.solver.texels.topology import sampling_matrix, with_filled_halo


def test_on_a_flat_square_texture_coordinates_are_the_points_themselves() -> None:
    atlas = texel_atlas(two_squares(4))
    found = atlas.texture_coordinates()
    points = found.carry(atlas.mesh.V[atlas.mesh.F])
    np.testing.assert_allclose(found.uv, points[..., :2], atol=1e-12)
    # the second chart is the square above
    np.testing.assert_array_equal(np.repeat(found.chart, 3), points[..., 2].ravel())
    np.testing.assert_allclose(found.coordinates[..., 1:], 4 * points[..., [1, 0]] - 0.5, atol=1e-12)


def cut_ball() -> tuple[Mesh, CubeChartMap]:
    V, F = icosphere(1)
    return Mesh(V, F), CubeChartMap(V)


def test_what_is_linear_in_a_triangle_is_carried_to_its_parts() -> None:
    mesh, chart_map = cut_ball()
    found = texture_coordinates(chart_map, mesh)
    assert len(found.triangle) > len(mesh.F)
    points = found.carry(mesh.V[mesh.F])
    # the same for vectors, numbers, and lists of them
    slope = np.array([0.3, -2.0, 1.0])
    np.testing.assert_allclose(found.carry((mesh.V @ slope)[mesh.F]), points @ slope, atol=1e-12)
    np.testing.assert_allclose(found.carry(mesh.V[mesh.F].tolist()), points)
    np.testing.assert_allclose(found.carry(np.ones((len(mesh.F), 3))), 1)
    # map coordinates are the sphere map carried along
    np.testing.assert_allclose(found.coordinates, points, atol=1e-12)


def test_parts_keep_the_winding_and_the_area_of_their_triangle() -> None:
    mesh, chart_map = cut_ball()
    found = texture_coordinates(chart_map, mesh)
    a, b, c = found.carry(mesh.V[mesh.F]).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a) / 2
    whole = mesh.V[mesh.F]
    outward = np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0])
    assert (np.einsum("ij,ij->i", normals, outward[found.triangle]) > 0).all()
    sums = np.bincount(found.triangle, np.linalg.norm(normals, axis=1))
    np.testing.assert_allclose(sums, mesh.triangle_areas)
    # counter-clockwise on the charts too
    assert (np.linalg.det(found.uv[:, 1:] - found.uv[:, :1]) > 0).all()


@pytest.mark.parametrize("topology", [cube_topology(4), square(4).topology])
def test_a_layer_with_halo_is_read_at_the_place_that_the_documentation_gives(topology) -> None:
    charts, n, _ = topology.shape
    rng = np.random.default_rng(0)
    chart, uv = rng.integers(0, charts, 200), rng.uniform(0, 1, (200, 2))
    # in a corner of three charts, halo and matrix differ but at the corner itself
    uv[:, 0] = uv[:, 0].clip(0.5 / n, 1 - 0.5 / n)
    field = rng.standard_normal(topology.shape)
    around = with_filled_halo(topology, field)
    # as a GPU filters: texel centres at halves
    column, row = ((1 + n * uv) / (n + 2) * (n + 2) - 0.5).T
    c, r = np.floor(column).astype(int), np.floor(row).astype(int)
    t, s = column - c, row - r
    read = (1 - s) * ((1 - t) * around[chart, r, c] + t * around[chart, r, c + 1])
    read += s * ((1 - t) * around[chart, r + 1, c] + t * around[chart, r + 1, c + 1])
    np.testing.assert_allclose(read, sampling_matrix(topology, chart, *(n * uv[:, ::-1].T - 0.5)) @ field.ravel())
