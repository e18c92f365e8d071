"""The stiffness of texel meshes, at rest and moving: cells and brute-force assembly."""

import numpy as np
import pytest
from hand_made import RIM, disk, flat_charts, flat_torus, polygon, square
from modes import orders

from ripple_sim.solver import TexelMesh, build_atlas, texel_atlas
from ripple_sim.solver.layouts.cube import cube_topology, sphere_atlas, texel_directions
from ripple_sim.solver.texels import SurfaceRide, TexelCells, polygons, quad

STRAIGHT = (0.0,) * 6


@pytest.mark.parametrize(("long", "angle"), [(1.0, 30.0), (2.0, 35.0), (3.0, 20.0), (1.3, 150.0)])
def test_waves_over_sheared_quads_are_in_time_on_average_over_directions(
    long: float, angle: float
) -> None:
    east = np.array([long, 0.0, 0.0])
    north = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    south, north_side, west, east_side, rising, falling, area = quad(
        east, north, east + north, STRAIGHT
    )
    direction = np.linspace(0, np.pi, 180, endpoint=False)
    errors = []
    for k in (0.2, 0.1):
        wave = k * np.stack([np.cos(direction), np.sin(direction), 0 * direction], axis=1)
        theta = wave @ east
        phi = wave @ north
        # every side belongs to two quads
        squared = (
            (south + north_side) * (2 - 2 * np.cos(theta))
            + (west + east_side) * (2 - 2 * np.cos(phi))
            + rising * (2 - 2 * np.cos(theta + phi))
            + falling * (2 - 2 * np.cos(theta - phi))
        ) / area
        errors.append(abs(np.mean(squared / k**2) - 1))
    # the error in k^2 is gone, that in k^4 is left
    assert errors[1] < errors[0] / 14


def test_a_quad_of_any_convex_shape_is_next_to_exact_for_linear_functions() -> None:
    rng = np.random.default_rng(5)
    ends = np.array([(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)])
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    for _ in range(50):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 4))[[0, 1, 3, 2]]
        corners = np.stack([np.cos(angle), 0.5 * np.sin(angle), 0 * angle], axis=1) @ turn
        slope = turn.T @ np.array([*rng.standard_normal(2), 0.0])
        *weights, area = quad(*(corners[1:] - corners[0]), STRAIGHT)
        if area < 0.1:
            continue
        matrix = np.zeros((4, 4))
        for (i, j), weight in zip(ends, weights, strict=True):
            matrix[[i, j], [j, i]] -= weight
            matrix[[i, j], [i, j]] += weight
        u = corners @ slope
        assert u @ matrix @ u == pytest.approx(area * slope @ slope, rel=2e-3)
        # three motions have energy, a constant has none, and none has less than none
        values = np.linalg.eigvalsh(matrix)
        assert (
            values[0] == pytest.approx(0, abs=1e-12 * values[-1]) and values[1] > 1e-3 * values[-1]
        )


@pytest.mark.parametrize("corners", [3, 4, 5, 8])
def test_a_cell_with_many_corners_is_exact_for_linear_functions(corners: int) -> None:
    rng = np.random.default_rng(corners)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    flat = np.stack([np.cos(angle), 0.6 * np.sin(angle), 0 * angle], axis=1)
    weights, areas = (each[:, 0] for each in polygons(flat.T[..., None]))
    slope = np.array([0.7, -1.3, 0.0])
    first, second = np.triu_indices(corners, 1)
    energy = weights @ (flat[first] @ slope - flat[second] @ slope) ** 2 / 2
    x, y, _ = flat.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert energy == pytest.approx(area * slope @ slope / 2)
    assert areas.sum() == pytest.approx(area)


def element(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Stiffness matrix and area of a cell with 3 or 4 corners [k, 3], in order round it."""
    if len(corners) == 4:
        frame = np.array([corners[2] - corners[0], corners[3] - corners[1]])
        differences = np.array([[-1.0, 0, 1, 0], [0, -1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    else:
        frame = corners[1:] - corners[0]
        differences = np.array([[-1.0, 1, 0], [-1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    # the gradient in space whose components along the frame are the differences
    gradient = np.linalg.pinv(frame) @ differences
    stiffness = area * gradient.T @ gradient
    if len(corners) == 4:
        hourglass = np.array([1.0, -1, 1, -1])
        # where the quad is uneven, linear functions have next to nothing of the pattern
        unevenness = np.linalg.lstsq(frame.T, hourglass @ corners, rcond=None)[0]
        share = unevenness @ unevenness / (unevenness @ unevenness + 1e-3)
        hourglass -= share * (hourglass @ corners @ gradient)
        stiffness += hourglass_stiffness(frame, area) * np.outer(hourglass, hourglass)
        triangles = corners[[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]]
        edges = triangles[:, 1:] - triangles[:, :1]
        twice = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        area = min(twice[:2].sum(), twice[2:].sum()) / 2
    return stiffness, area


def hourglass_stiffness(diagonals: np.ndarray, area: float) -> float:
    """The limit that waves in time need, but no more than the time step allows."""
    first = (diagonals[0] - diagonals[1]) / 2
    second = (diagonals[0] + diagonals[1]) / 2
    long = max(first @ first, second @ second)
    both = first @ first + second @ second
    in_time = both * area / 2 / (area**2 + 3 * (first @ second) ** 2)
    free = (long**2 - (first @ second) ** 2) / (4 * long * area)
    return min(in_time, max(0.75 * free, 0.4 * 2 * area / both))


def cell_by_cell(texels: TexelMesh, k: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix and areas of a mesh without rims, by loops over cells and corners."""
    topology = texels.topology
    around = texels.halo_positions
    k = k.ravel()
    s = s.ravel()
    count = topology.texel_count
    matrix = np.zeros((count, count))
    areas = np.zeros(count)
    seen = set()
    charts, n, _ = topology.shape
    for chart, r, c in np.ndindex(charts, n + 1, n + 1):
        places = [(r, c), (r, c + 1), (r + 1, c + 1), (r + 1, c)]
        there = [(int(topology.halo[chart, *place]), around[chart, *place]) for place in places]
        indices, points = zip(
            *[(index, point) for index, point in there if index >= 0], strict=True
        )
        if frozenset(indices) in seen:
            continue
        seen.add(frozenset(indices))
        ring = list(indices)
        stiffness, area = element(np.array(points))
        matrix[np.ix_(ring, ring)] += len(ring) / (1 / k[ring]).sum() * s[ring].min() * stiffness
        areas[ring] += area / len(ring)
    return matrix, areas


def test_coefficients_and_softening_of_every_cell_count_once(bumpy: TexelMesh) -> None:
    rng = np.random.default_rng(0)
    # rows and columns of uneven width, on a slope: no two cells are alike
    flat = flat_torus(5)
    bend = flat.beyond + 0.03 * np.sin(
        2 * np.pi * flat.beyond @ np.array([[1, 0, 2], [1, 1, 0], [0, 0, 0]])
    )
    for texels in (bumpy, TexelMesh.of(flat.topology, bend[:, 1:-1, 1:-1], beyond=bend)):
        k = rng.uniform(0.2, 4, texels.shape)
        s = rng.uniform(0.1, 1, texels.shape)
        matrix, areas = cell_by_cell(texels, k, s)
        field = rng.standard_normal(texels.shape)
        np.testing.assert_allclose(
            -texels.stencil(k, s)(field).ravel(), matrix @ field.ravel(), atol=1e-11
        )
        np.testing.assert_allclose(texels.cells.areas.ravel(), areas, rtol=1e-12)


@pytest.mark.parametrize("k", [1, 2, 5])
def test_strips_at_free_edges_make_the_modes_of_a_string_with_free_ends(k: int) -> None:
    n = 6
    texels = square(n)
    mode = np.broadcast_to(np.cos(np.pi * k * (np.arange(n) + 0.5) / n), (1, n, n))
    stencil = texels.stencil(np.ones(texels.shape))
    for wave in (mode, mode.transpose(0, 2, 1)):
        np.testing.assert_allclose(
            -stencil(wave), (2 - 2 * np.cos(np.pi * k / n)) * wave, atol=1e-12
        )
    np.testing.assert_allclose(texels.areas, 1 / n**2)


def test_charts_turned_against_each_other_and_a_rim_make_the_same_surface() -> None:
    left = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    right = left + np.array([1, 0, 0])
    n = 4
    field = np.random.default_rng(1).standard_normal((n, 2 * n))
    expected = None
    for turn in range(4):
        # the right chart begins at another corner; the side that faces the left one is its side 3 -
        # turn
        side = (3 - turn) % 4
        glued = [[RIM, (1, side), RIM, RIM], [(0, 1) if i == side else RIM for i in range(4)]]
        texels = flat_charts([left, np.roll(right, -turn, axis=0)], glued, n)
        column, row = np.rint(texels.positions[..., :2] * n - 0.5).astype(int).transpose(3, 0, 1, 2)
        force = texels.stencil(np.ones(texels.shape))(field[row, column])
        found = np.empty_like(field)
        found[row, column] = force
        expected = found if expected is None else expected
        np.testing.assert_allclose(found, expected, atol=1e-12)
        np.testing.assert_allclose(texels.areas, 1 / n**2)


def test_layers_in_series_carry_the_same_flux() -> None:
    n = 6
    columns = np.array([1.0, 5.0, 0.2, 3.0, 3.0, 0.5])
    texels = square(n)
    # what a layered medium holds in balance: its slope times the mean of the layers' resistances is
    # the flux
    steps = (1 / columns[:-1] + 1 / columns[1:]) / 2
    height = np.broadcast_to(np.concatenate([[0], np.cumsum(steps)]), (1, n, n))
    force = texels.stencil(np.broadcast_to(columns, (1, n, n)).copy())(height)
    np.testing.assert_allclose(force[0, :, 1:-1], 0, atol=1e-12)
    np.testing.assert_allclose(force[0, :, 0], 1)
    np.testing.assert_allclose(force[0, :, -1], -1)


def test_a_triangle_with_a_corner_of_coefficient_0_is_cut_off() -> None:
    texels = polygon(3, 4)
    coefficient = np.ones(texels.shape)
    coefficient[0, 0, 0] = 0
    force = texels.stencil(coefficient)(np.random.default_rng(2).standard_normal(texels.shape))
    assert force[0, 0, 0] == 0
    assert np.isfinite(force).all() and force.sum() == pytest.approx(0, abs=1e-12)


def test_where_a_rim_has_no_positions_the_surface_ends_at_the_last_texels() -> None:
    n = 5
    texels = square(n)
    ends = TexelMesh.of(texels.topology, texels.positions)
    share = np.full((n, n), 4.0)
    share[[0, -1]] /= 2
    share[:, [0, -1]] /= 2
    np.testing.assert_allclose(ends.areas[0], share / 4 / n**2)


def test_texels_in_one_point_have_neither_area_nor_weight() -> None:
    topology = cube_topology(4)
    texels = TexelMesh.of(topology, np.ones((*topology.shape, 3)))
    assert not texels.areas.any()
    assert not texels.stencil(np.ones(topology.shape)).weights.any()


def test_sphere_area_converges_at_second_order() -> None:
    error = [
        4 * np.pi - TexelMesh.of(cube_topology(n), texel_directions(n)).areas.sum()
        for n in (8, 16, 32, 64)
    ]
    assert (orders(error) > 1.95).all()


SURFACES = {
    "sphere": lambda: sphere_atlas(1.0, 6),
    "three charts round a point": lambda: texel_atlas(polygon(3, 4)),
    "five charts round a point": lambda: texel_atlas(polygon(5, 4)),
    "disk": lambda: texel_atlas(disk(6)),
    "square": lambda: texel_atlas(square(6)),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("fixed", [False, True], ids=["free", "fixed"])
def test_weights_and_areas_are_those_of_the_texels_where_they_are(name, fixed):
    atlas = SURFACES[name]()
    texels = atlas.texels.with_fixed_rim() if fixed else atlas.texels
    rng = np.random.default_rng(4)
    V = atlas.mesh.V @ (np.eye(3) + 0.3 * rng.standard_normal((3, 3))) + 10.0
    around = SurfaceRide(atlas).around(V)
    speeds, soft = rng.uniform(1, 2, (2, *texels.shape)) / [[[[1]]], [[[2]]]]
    cells = texels.cells
    stencil, areas = cells.moved(around, cells.coefficient(speeds, soft, 0.0))
    beside = np.moveaxis(around, 0, -1)
    there = TexelCells(texels.topology, beside)
    exact = there.at_rest(speeds, soft)
    np.testing.assert_allclose(
        stencil.weights, exact.weights, atol=3e-6 * np.abs(exact.weights).max()
    )
    np.testing.assert_allclose(stencil.irregular.weights, exact.irregular.weights, atol=1e-6)
    np.testing.assert_allclose(stencil.irregular.others, exact.irregular.others)
    np.testing.assert_allclose(areas, there.areas, rtol=3e-6)


def test_crushed_cells_have_finite_weights():
    atlas = SURFACES["disk"]()
    cells = atlas.texels.cells
    ones = np.ones(atlas.areas.shape)
    for V in (0 * atlas.mesh.V, atlas.mesh.V * [1, 0, 1]):
        stencil, areas = cells.moved(
            SurfaceRide(atlas).around(V), cells.coefficient(ones, ones, -1.0)
        )
        assert np.isfinite(stencil.weights).all()
        assert np.isfinite(areas).all()


@pytest.mark.parametrize("kind", ["sphere", "patches"])
def test_texels_keep_their_places_under_any_affine_motion_of_a_mesh(kind):
    atlas = SURFACES["sphere"]()
    if kind == "patches":
        atlas = build_atlas(atlas.mesh, 8, layout="patches")
    M = np.eye(3) + 0.3 * np.random.default_rng(1).standard_normal((3, 3))
    positions, _ = SurfaceRide(atlas).positions(atlas.mesh.V @ M.T + [1, 2, 3])
    np.testing.assert_allclose(positions, atlas.positions @ M.T + [1, 2, 3], atol=1e-12)
