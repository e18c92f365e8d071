"""From cells to charts: sizes, quads, and maps that stay one to one."""

import itertools

import numpy as np
import pytest
import trimesh
from genus_zero import TETRAHEDRON
from scipy.spatial import ConvexHull
from surfaces import disk, sphere, torus

from ripple_sim.solver import Mesh, glue
from ripple_sim.solver.layouts import FIXED, FREE, System, patches
from ripple_sim.solver.layouts.patches import Metric, Quads, SeamlessMap, TriangleSurface
from ripple_sim.solver.mesh import edges_of


def test_sizes_keep_to_their_bounds() -> None:
    ball = sphere(3)
    sizes = patches.cell_sizes(Metric.of(TriangleSurface.of(ball.V, ball.F)), 0.5, (0.2, 0.3), 96)
    assert sizes.min() >= 0.2
    assert sizes.max() <= 0.3 + 1e-12


def test_needles_do_not_multiply_cells() -> None:
    """Ways across needles were many times too long; a ring of 10,000 got thousands of cells."""
    seeds = []
    for sections in (24, 600):
        ring = trimesh.creation.annulus(r_min=0.5, r_max=1.0, height=0.3, sections=sections)
        mesh = Mesh.from_arrays(ring.vertices, ring.faces)
        surface = patches.refined(TriangleSurface.of(mesh.V, mesh.F), 0.07)
        seeds.append(len(patches.spread_seeds(Metric.of(surface), 0.25)))
    assert seeds[1] < 1.5 * seeds[0]


def test_texels_on_limbs_are_neither_folded_nor_wide() -> None:
    ball = sphere(4)
    tips = TETRAHEDRON[0] / np.sqrt(3)
    radius = 1 + 3.0 * np.exp(40.0 * (ball.V @ tips.T - 1)).sum(axis=1)
    atlas = patches.patch_atlas(Mesh.from_arrays(ball.V * radius[:, None], ball.F), 64)
    quality = atlas.quality()
    assert quality["folded"] == 0
    assert quality["timestep"] > 0.5
    assert np.quantile(atlas.areas, 0.999) < 3 * np.median(atlas.areas)


MESHES = {"sphere": lambda: sphere(3), "torus": lambda: torus(24), "disk": lambda: disk(14)}
EULER = {"sphere": 2, "torus": 0, "disk": 1}


def cells_of(name: str, cells: int) -> patches.BorderedCells:
    mesh = MESHES[name]()
    surface = TriangleSurface.of(mesh.V, mesh.F)
    metric = Metric.of(surface)
    reach = 0.75 * np.sqrt(surface.areas.sum() / cells) if cells > 1 else np.inf
    return patches.disk_cells(
        metric, patches.centred_cells(metric, patches.spread_seeds(metric, reach))
    )


def quads_of(name: str, cells: int) -> Quads:
    return patches.cut_into_quads(cells_of(name, cells))


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("cells", [1, 6, 12])
def test_quads_cover_the_surface_and_their_squares_once(name: str, cells: int) -> None:
    quads = quads_of(name, cells)
    assert_covered_once(name, quads)
    assert_topology(name, quads)


@pytest.mark.parametrize("name", MESHES)
def test_large_quads_cover_the_surface_once_and_three_meet_at_least(name: str) -> None:
    cells = cells_of(name, 24)
    quads = patches.cut_into_large_quads(cells)
    assert quads is not None
    assert_covered_once(name, quads)
    assert len(quads.glued) < 1.5 * len(cells.arcs) < 0.5 * sum(map(len, cells.arcs))
    topology = glue(quads.glued, 2)
    assert topology.valence[topology.valence > 0].min() >= 3
    assert_topology(name, quads)


def test_a_surface_of_too_few_cells_has_no_large_quads() -> None:
    assert patches.cut_into_large_quads(cells_of("sphere", 4)) is None


def assert_covered_once(name: str, quads: Quads) -> None:
    areas = patches.signed_areas(quads.places)
    assert areas.min() > 0
    np.testing.assert_allclose(np.bincount(quads.chart, areas), 1.0, atol=1e-9)
    assert quads.surface.areas.sum() == pytest.approx(MESHES[name]().area)


def assert_topology(name: str, quads: Quads) -> None:
    glued = quads.glued
    corners = len(np.unique(glue(glued, 2).corners))
    sides = (glued[..., 0] >= 0).sum() / 2 + (glued[..., 0] < 0).sum()
    assert corners - sides + len(glued) == EULER[name]


@pytest.fixture(scope="module", params=["torus", "disk"])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def mesh(name: str) -> Mesh:
    return MESHES[name]()


@pytest.fixture(scope="module")
def quads(name: str) -> Quads:
    return quads_of(name, 8)


def assert_one_to_one(seamless: SeamlessMap) -> np.ndarray:
    """Check that no triangle is folded, and each chart covered once; return the corners."""
    places = patches.corner_places(seamless)
    areas = patches.signed_areas(np.stack([places.real, places.imag], axis=-1))
    assert areas.min() > 0
    np.testing.assert_allclose(areas.sum(), len(seamless.glued), rtol=1e-9)
    assert (patches.locate_texels(seamless, 9)[0] >= 0).all()
    return places


def test_fewer_triangles_cover_the_same_surface_and_charts_once(mesh: Mesh, quads: Quads) -> None:
    whole = patches.seamless_map(quads)
    surface, seamless = patches.without_cuts(quads.surface, whole, quads.cut)
    assert len(surface.F) < 0.7 * len(quads.surface.F)
    assert_one_to_one(seamless)
    # each triangle of the mesh is covered once, by triangles that lie where they say
    share = np.linalg.det(surface.inside)
    assert share.min() > 0
    np.testing.assert_allclose(np.bincount(surface.parent, share), 1.0, rtol=1e-9)
    points = np.einsum("fij,fjk->fik", surface.inside, mesh.V[mesh.F[surface.parent]])
    np.testing.assert_allclose(points, surface.V[surface.F], atol=1e-12)
    assert np.bincount(surface.edges.of_side.ravel()).max() == 2
    assert (seamless.freedom == FIXED).sum() == (whole.freedom == FIXED).sum()


def test_a_relaxed_map_covers_the_charts_once_with_less_energy(quads: Quads) -> None:
    seamless = patches.seamless_map(quads)
    reference = patches.reference_of(quads.surface.V, quads.surface.F, len(quads.glued))
    before = patches.total_energy(seamless, reference)
    patches.relax(quads.surface.V, seamless)
    assert_one_to_one(seamless)
    inside = np.concatenate([seamless.z.real, seamless.z.imag])
    assert (inside >= 0).all() and (inside <= 1).all()
    assert patches.total_energy(seamless, reference) < 0.9 * before


def test_a_triangle_without_area_is_opened_before_the_map_is_evened_out(quads: Quads) -> None:
    """One of them made the energy infinite, and thirty Newton steps moved nothing."""
    seamless = patches.seamless_map(quads)
    triangle = np.flatnonzero(
        (seamless.freedom[seamless.F] == FREE).all(axis=1)
        & (seamless.turn == 0).all(axis=1)
        & (seamless.shift == 0).all(axis=1)
    )[0]
    a, b, c = seamless.F[triangle]
    reference = patches.reference_of(quads.surface.V, quads.surface.F, len(quads.glued))
    seamless.z[a] = (seamless.z[b] + seamless.z[c]) / 2
    assert patches.total_energy(seamless, reference) == np.inf
    patches.relax(quads.surface.V, seamless)
    assert patches.total_energy(seamless, reference) < np.inf
    assert_one_to_one(seamless)


def test_newtons_gradient_is_the_slope_of_the_energy(quads: Quads) -> None:
    seamless = patches.seamless_map(quads)
    reference = patches.reference_of(quads.surface.V, quads.surface.F, len(quads.glued))
    edges = edges_of(seamless.F)
    ends = edges.ends.astype(np.int32)
    system = System.zeros(len(seamless.z), len(ends))
    patches.assemble(seamless, reference, edges.of_side, ends, system)
    way = np.random.default_rng(0).normal(size=(len(seamless.z), 2))
    way[seamless.freedom == FIXED] = 0
    start = seamless.z.copy()
    step = 1e-9
    energies = []
    for t in (step, -step):
        seamless.z[:] = start + t * way @ (1, 1j)
        energies.append(patches.total_energy(seamless, reference))
    assert (system.gradient * way).sum() == pytest.approx(
        (energies[0] - energies[1]) / (2 * step), rel=1e-4
    )


def test_moved_tips_lower_the_energy_and_leave_the_map_one_to_one(quads: Quads) -> None:
    seamless = patches.seamless_map(quads)
    reference = patches.reference_of(quads.surface.V, quads.surface.F, len(quads.glued))
    tips = np.flatnonzero(seamless.freedom == FIXED)
    before = patches.total_energy(seamless, reference)
    assert len(patches.move_tips(seamless, reference, tips))
    assert patches.total_energy(seamless, reference) < before
    assert (seamless.freedom == FIXED).sum() == len(tips)
    places = assert_one_to_one(seamless)
    total = np.zeros(len(seamless.z))
    for k in range(3):
        u = places[:, (k + 1) % 3] - places[:, k]
        v = places[:, (k + 2) % 3] - places[:, k]
        angle = np.angle(v / u)
        total += np.bincount(seamless.F[:, k], angle, len(total))
    np.testing.assert_allclose(total[seamless.freedom == FREE] / (2 * np.pi), 1.0, atol=1e-9)


def hull(points: int) -> tuple[tuple[np.ndarray, ...], int, np.ndarray]:
    """Triangles of a random convex hull, their sides, and the valence of each point."""
    V = np.random.default_rng(points).normal(size=(points, 3))
    F = ConvexHull(V / np.linalg.norm(V, axis=1, keepdims=True)).simplices.astype(np.int64)
    pairs = [
        (i, j)
        for i, j in itertools.combinations(range(len(F)), 2)
        if len(set(F[i]) & set(F[j])) == 2
    ]
    ends = [sorted(set(F[i]) & set(F[j])) for i, j in pairs]
    return (np.array(pairs), np.array(ends), np.zeros(len(pairs))), len(F), np.bincount(F.ravel())


def pairings(pairs: np.ndarray, left: frozenset[int]) -> list[list[int]]:
    if not left:
        return [[]]
    here = min(left)
    ways = [k for k in range(len(pairs)) if here in pairs[k] and set(pairs[k]) <= left]
    return [[k, *rest] for k in ways for rest in pairings(pairs, left - set(pairs[k]))]


def off(middles: np.ndarray, corners: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """By how much the quads round each point differ from four."""
    return np.abs(corners - np.bincount(middles[chosen].ravel(), minlength=len(corners)) - 4)


@pytest.mark.parametrize("points", [12, 14])
def test_the_best_of_all_pairings_is_found(points: int) -> None:
    joints, count, corners = hull(points)
    chosen = patches.chosen_joints(*joints, count, corners, np.full(points, 4.0))
    assert chosen is not None
    assert (np.bincount(joints[0][chosen].ravel()) == 1).all()
    ways = [
        off(joints[1], corners, np.array(each))
        for each in pairings(joints[0], frozenset(range(count)))
    ]
    cost = [(each + 2 * np.maximum(each - 1, 0)).sum() for each in ways if each.max() < 2]
    found = off(joints[1], corners, chosen)
    assert (found + 2 * np.maximum(found - 1, 0)).sum() == min(cost)


def test_one_of_an_odd_number_of_triangles_stays_alone() -> None:
    # three in a row, round points that have enough of others
    joints = (
        np.array([[0, 1], [1, 2], [0, -1], [2, -1]]),
        np.array([[0, 1], [1, 2], [3, 4], [5, 6]]),
        np.zeros(4),
    )
    chosen = patches.chosen_joints(*joints, 3, np.full(7, 5), np.full(7, 4.0))
    assert chosen is not None
    alone = joints[0][chosen, 1] < 0
    assert alone.sum() == 1
    assert sorted(joints[0][chosen][joints[0][chosen] >= 0]) == [0, 1, 2]


def test_there_is_no_pairing_of_triangles_that_have_no_side_in_common() -> None:
    none = np.empty((0, 2), np.int64), np.empty((0, 2), np.int64), np.empty(0)
    assert patches.chosen_joints(*none, 2, np.full(3, 5), np.full(3, 4.0)) is None
