"""Atlases of the patch layout of any surface; eigenvalues against exact ones."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from all_kinds import band, graph, punctured_ball, voxels
from hand_made import eigenvalues, square_eigenvalues
from known_meshes import known_mesh
from surfaces import disk, grid, joined, moved, sphere, square, torus

from ripple_sim.solver import (
    Atlas,
    AtlasError,
    Material,
    Mesh,
    TexelMesh,
    WaveSolver,
    build_atlas,
    glue,
    load_atlas,
    load_mesh,
)
from ripple_sim.solver.layouts.patches import (
    atlas_from_patch_map,
    centres,
    layout,
    patch_map,
    quads,
)
from ripple_sim.solver.layouts.patches.atlas import chart_side
from ripple_sim.solver.layouts.patches.quads import Quads
from ripple_sim.solver.layouts.patches.surface import TriangleSurface
from ripple_sim.solver.texels import folded_texels


def blade() -> Mesh:
    ball = sphere(3)
    return Mesh.from_arrays(ball.V * [1.0, 0.6, 0.03], ball.F)


MESHES = {
    "sphere": lambda: sphere(3),
    "torus": lambda: torus(24),
    "square": lambda: square(6),
    "disk": lambda: disk(12),
    "one triangle": lambda: Mesh.from_arrays(np.eye(3), [[0, 1, 2]]),
    "knife edge": blade,
    "two parts": lambda: joined(sphere(2), moved(disk(8), (3, 0, 0), 0.5)),
}


@pytest.fixture(scope="module", params=MESHES)
def atlas(request: pytest.FixtureRequest) -> Atlas:
    return build_atlas(MESHES[request.param](), 24, cache=False, layout="patches")


def test_texels_lie_in_their_triangles(atlas: Atlas) -> None:
    corners = atlas.mesh.V[atlas.mesh.F[atlas.triangles]]
    points = np.einsum("...k,...kj->...j", atlas.barycentrics, corners)
    np.testing.assert_allclose(points, atlas.positions, atol=1e-12)
    assert atlas.barycentrics.min() > -1e-6
    np.testing.assert_allclose(atlas.barycentrics.sum(axis=-1), 1.0, atol=1e-9)


def test_no_triangle_is_folded_and_every_texel_is_found_where_it_lies(atlas: Atlas) -> None:
    assert atlas.quality()["flipped"] == 0
    np.testing.assert_array_equal(
        atlas.nearest_texel(atlas.positions.reshape(-1, 3)), np.arange(atlas.areas.size)
    )
    chart, row, column = atlas.locate(atlas.positions.reshape(-1, 3))
    place = np.stack([chart, row, column]).reshape(3, *atlas.areas.shape)
    np.testing.assert_allclose(place, np.indices(atlas.areas.shape), atol=1e-5)


def test_the_areas_add_up_to_the_surface(atlas: Atlas) -> None:
    assert atlas.quality()["coverage"] == pytest.approx(1.0, abs=1e-4)
    assert (atlas.areas > 0).all()


def test_neighbours_across_a_border_of_charts_are_neighbours_on_the_surface(atlas: Atlas) -> None:
    quality = atlas.quality()
    assert quality["edge_max"] < 4 * np.sqrt(atlas.areas.max())


def test_places_beyond_a_rim_lie_on_the_rim(atlas: Atlas) -> None:
    topology = atlas.texels.topology
    if not topology.rim.any():
        assert atlas.mesh.closed
        return
    points = atlas.texels.beyond[topology.rim]
    ends = atlas.mesh.V[
        np.concatenate([np.stack([rim, np.roll(rim, -1)], axis=1) for rim in atlas.mesh.rims])
    ]
    along = ends[:, 1] - ends[:, 0]
    share = np.einsum("pek,ek->pe", points[:, None] - ends[:, 0], along) / (along**2).sum(axis=1)
    nearest = ends[:, 0] + np.clip(share, 0, 1)[..., None] * along
    assert np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max() < 1e-9


def test_a_wave_keeps_its_energy(atlas: Atlas) -> None:
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[0, 1, 1], 1e-3, 0.3)
    before = waves.energy()
    waves.step(0.5, substeps=400)
    assert waves.energy() == pytest.approx(before, rel=1e-3)


def test_texture_coordinates_cover_every_triangle_once(atlas: Atlas) -> None:
    pieces = atlas.texture_coordinates()
    share = np.abs(np.linalg.det(pieces.barycentrics))
    np.testing.assert_allclose(
        np.bincount(pieces.triangle, share, len(atlas.mesh.F)), 1.0, atol=1e-6
    )
    u, v = np.moveaxis(pieces.uv[:, 1:] - pieces.uv[:, :1], 1, 0)
    flat = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    np.testing.assert_allclose(np.bincount(pieces.chart, flat, len(atlas.areas)), 1.0, atol=1e-6)


def test_parts_share_the_texels_by_area() -> None:
    mesh = joined(sphere(2), moved(sphere(2), (3, 0, 0), 0.7))
    atlas = build_atlas(mesh, 32, cache=False, layout="patches")
    small = mesh.components[atlas.triangles] == 1
    assert small.mean() == pytest.approx(0.7**2 / (1 + 0.7**2), abs=0.08)
    # no chart holds texels of both
    assert (small.all(axis=(1, 2)) | ~small.any(axis=(1, 2))).all()


def test_auto_takes_patches_where_the_cube_does_not_fit() -> None:
    assert build_atlas(sphere(2), 8, cache=False).layout == "cube"
    assert build_atlas(torus(6), 8, cache=False).layout == "patches"


def test_unknown_layouts_are_refused() -> None:
    with pytest.raises(AtlasError, match="must be one of 'auto', 'cube', 'patches'"):
        build_atlas(sphere(1), 8, layout="hexagons")


def test_the_same_mesh_gives_the_same_atlas() -> None:
    one, other = (build_atlas(torus(8), 16, cache=False) for _ in range(2))
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_array_equal(one.areas, other.areas)


def thick_graph(genus: int) -> Mesh:
    """Bars along a random graph on a cube's corners with given cycles, vertices shaken."""
    rng = np.random.default_rng(genus)
    filled = np.zeros((5, 5, 5), bool)
    for ends in graph(genus, rng, size=2):
        filled[tuple(2 * ends.astype(int).T + 1)] = filled[
            tuple(ends.sum(axis=0).astype(int) + 1)
        ] = True
    bars = Mesh.from_arrays(*voxels(filled))
    return Mesh.from_arrays(bars.V + rng.uniform(-0.2, 0.2, bars.V.shape), bars.F)


CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
ANY_MESH: dict[str, Callable[[], Mesh]] = {
    **{f"graph of genus {genus}": (lambda genus=genus: thick_graph(genus)) for genus in (0, 2, 5)},
    "sphere with 1 hole": lambda: Mesh.from_arrays(*punctured_ball(1, 1)),
    "sphere with 6 holes": lambda: Mesh.from_arrays(*punctured_ball(6, 6)),
    "strip": lambda: Mesh.from_arrays(*grid(12, lambda x, y: (10 * x, y, 0 * x))),
    "Moebius band": lambda: Mesh.from_arrays(*band(1)),
    "1 triangle": lambda: Mesh.from_arrays(CORNERS, [[0, 1, 2]]),
    "2 triangles": lambda: Mesh.from_arrays(CORNERS, [[0, 1, 2], [1, 3, 2]]),
    "4 triangles": lambda: Mesh.from_arrays(CORNERS, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    "needle": lambda: Mesh.from_arrays([[0, 0, 0], [1, 0, 0], [0.5, 0.05, 0]], [[0, 1, 2]]),
    "needles": lambda: Mesh.from_arrays(sphere(1).V * [1, 1, 10], sphere(1).F),
    "teapot": lambda: load_mesh(known_mesh("bad/several-parts-teapot.obj")),
    "3 holes": lambda: load_mesh(known_mesh("bad/genus3-3holes.off")),
    "rocker arm": lambda: load_mesh(known_mesh("bad/genus1-rocker-arm.obj")),
}


@pytest.mark.parametrize("name", ANY_MESH)
def test_any_mesh_carries_waves(name: str) -> None:
    assert_atlas_carries_waves(build_atlas(ANY_MESH[name](), 16, cache=False, layout="patches"))


def assert_atlas_carries_waves(atlas: Atlas) -> None:
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert np.isfinite(atlas.positions).all()
    assert (atlas.areas > 0).all()
    assert quality["coverage"] == pytest.approx(1.0, abs=0.02)
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[0, 1, 1], 1e-3, 0.0)
    before = waves.energy()
    waves.step(64 * waves.stable_timestep)
    assert waves.energy() < 1.5 * before


def test_a_surface_too_long_for_its_width_is_refused_at_once() -> None:
    """It would be cut into a row of thousands of cells, for minutes."""
    long = Mesh.from_arrays(sphere(1).V * [1, 1, 1e6], sphere(1).F)
    with pytest.raises(AtlasError, match="times as long as wide"):
        build_atlas(long, 16, cache=False, layout="patches")


def test_a_surface_slightly_too_long_gets_fewer_cells(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(quads, "_MAX_LENGTH_TIMES_CELLS", 20**2)
    assert_atlas_carries_waves(build_atlas(ANY_MESH["strip"](), 16, cache=False, layout="patches"))


def test_a_strip_a_thousand_times_as_long_as_wide_gets_fewer_cells() -> None:
    along = np.arange(1001.0)
    V = np.array([[x, y, 0.0] for x in along for y in (0.0, 1.0)])
    first = 2 * np.arange(1000)[:, None]
    F = np.concatenate([first + np.array([0, 2, 1]), first + np.array([1, 2, 3])])
    assert_atlas_carries_waves(build_atlas(Mesh.from_arrays(V, F), 16, cache=False))


def test_many_parts_of_negligible_area_carry_waves(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a thousand parts, in less time."""
    monkeypatch.setattr(layout, "_NEGLIGIBLE_AREA", 0.3)
    solid = trimesh.creation.box((1, 1, 1))
    V = np.concatenate([solid.vertices + np.array([2 * i, 0, 0]) for i in range(4)])
    F = np.concatenate([solid.faces + len(solid.vertices) * i for i in range(4)])
    assert_atlas_carries_waves(build_atlas(Mesh.from_arrays(V, F), resolution=16, cache=False))


def spout() -> Mesh:
    """An open tube, half as wide at its end."""
    around = 8
    along = 4
    row, column = np.divmod(np.arange(around * (along + 1)), around)
    radius = 0.04 * (1 - row / (2 * along))
    angle = 2 * np.pi / around * column
    V = np.stack([0.1 * row, radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    a = np.arange(around * along)
    b = a - a % around + (a + 1) % around
    return Mesh.from_arrays(
        V,
        np.concatenate([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]),
    )


def test_a_small_tube_beside_a_sheet_gets_charts_without_a_fold() -> None:
    mesh = joined(moved(square(12), (-6, -6, 0), 12), moved(spout(), (0, 0, 0.5)))
    atlas = build_atlas(mesh, 48, cache=False)
    assert atlas.quality()["flipped"] == 0
    assert set(mesh.components[atlas.triangles].ravel()) == {0, 1}


def two_rectangles() -> Mesh:
    sheet = np.array([[0.0, 0, 0], [550, 0, 0], [550, 550, 0], [0, 550, 0]])
    lamp = np.array([[200.0, 200, 50], [330, 200, 50], [330, 305, 50], [200, 305, 50]])
    F = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh.from_arrays(np.concatenate([sheet, lamp]), np.concatenate([F, F + 4]))


def test_pieces_without_area_are_left_out() -> None:
    atlas = build_atlas(two_rectangles(), 24, cache=False)
    assert atlas.quality()["flipped"] == 0
    share = np.abs(np.linalg.det(atlas.chart_map.pieces.barycentrics))
    covered = np.bincount(atlas.chart_map.pieces.triangle, share)
    np.testing.assert_allclose(covered, 1.0, atol=1e-9)


def ball_and_crumbs() -> Mesh:
    """A ball, and 30 tetrahedra round it of which each is smaller than a texel."""
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    crumb = Mesh.from_arrays(corners, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    places = np.random.default_rng(0).normal(size=(30, 3))
    places *= 1.5 / np.linalg.norm(places, axis=1, keepdims=True)
    crumbs = [moved(crumb, tuple(place), 0.003) for place in places]
    return joined(sphere(2), *crumbs)


@pytest.fixture(scope="module")
def crumbly() -> Atlas:
    return build_atlas(ball_and_crumbs(), 24, cache=False)


def test_parts_smaller_than_a_few_texels_lie_still_and_are_named_once(crumbly: Atlas) -> None:
    (note,) = crumbly.notes
    assert note.startswith("30 of 31 parts lie still: each smaller than 12 texels")
    assert crumbly.texels.topology.still.sum() == 1
    quality = crumbly.quality()
    assert quality["flipped"] == quality["folded"] == 0
    assert quality["coverage"] == pytest.approx(1.0, abs=1e-4)


def test_a_heap_of_small_parts_carries_waves_on_all_but_a_twentieth_of_its_area() -> None:
    """Each part is smaller than twelve texels, so that charts are as small as can be."""
    count = 60
    part = moved(sphere(0), (0, 0, 0), 0.4)
    mesh = joined(*(moved(part, (i, 0, 0), 1.0) for i in range(count)))
    atlas = build_atlas(mesh, 10, cache=False)
    waves = ~atlas.texels.topology.still
    carried = len(np.unique(mesh.components[atlas.triangles[waves]]))
    assert 0.95 * count <= carried < count
    assert atlas.resolution == 2
    assert_atlas_carries_waves(atlas)


@pytest.mark.parametrize(
    ("charts", "side"),
    [
        pytest.param(6, 48, id="a cube"),
        pytest.param(864, 4, id="as many texels as asked for"),
        pytest.param(2592, 4, id="three times as many, in charts of the usual least size"),
        pytest.param(2593, 3, id="more, unless charts are smaller"),
        pytest.param(6660, 2, id="smaller still"),
        pytest.param(20_000, 2, id="smallest"),
    ],
)
def test_many_charts_are_small_so_that_texels_are_about_as_many_as_asked_for(
    charts: int, side: int
) -> None:
    assert chart_side(charts, 48) == side


def test_charts_of_2_x_2_texels_are_as_exact_as_larger_ones() -> None:
    """Eigenvalues of the unit sphere up to degree 3; errors in units of the area of a texel."""
    mesh = sphere(3)
    exact = degrees(lambda d: 2 * d + 1)[1:16]
    errors = {}
    for cells, resolution in ((96, 8), (24, 11)):
        atlas = atlas_from_patch_map(mesh, patch_map(mesh.V, mesh.F, cells), resolution)
        texels = TexelMesh.of(
            atlas.texels.topology, on_sphere(atlas.positions), normals=atlas.normals
        )
        found = eigenvalues(texels, 16)[1:]
        errors[atlas.resolution] = np.abs(found / exact - 1).max() / texels.areas.mean()
    assert sorted(errors) == [2, 4]
    assert errors[2] < 1.5 * errors[4]


def test_parts_on_which_texels_would_be_tiny_lie_still_and_are_named_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As thin rings do, which have many charts for their area."""
    monkeypatch.setattr(layout, "_MAX_CROWDING", 0.5)
    rings = [moved(torus(6), (x, 0, 0), 0.1) for x in (3, -3)]
    atlas = build_atlas(joined(sphere(2), *rings), 24, cache=False)
    (note,) = atlas.notes
    assert "near (3, " in note
    assert note.endswith(
        "lies still, and so does 1 more: texels would be less than half as wide as elsewhere"
    )
    is_ring = np.abs(atlas.positions[..., 0]) > 2
    still = atlas.texels.topology.still
    assert is_ring[still].all()
    assert not is_ring[~still].any()


def test_the_largest_part_with_charts_carries_waves_however_tiny_its_texels() -> None:
    shares = np.array([0.97, 0.02, 0.01])
    charts = np.array([0, 12, 12])  # the largest part could not be laid out
    assert list(layout._crowded(charts, shares, 100)) == [2]


def test_every_texel_of_a_part_that_lies_still_is_found_where_it_lies(crumbly: Atlas) -> None:
    still = np.flatnonzero(crumbly.texels.topology.still)
    points = crumbly.positions[still].reshape(-1, 3)
    n = crumbly.resolution
    np.testing.assert_array_equal(crumbly.nearest_texel(points) // (n * n), still[0])
    corners = crumbly.mesh.V[crumbly.mesh.F[crumbly.triangles]]
    np.testing.assert_allclose(
        np.einsum("...k,...kj->...j", crumbly.barycentrics, corners), crumbly.positions, atol=1e-12
    )
    pieces = crumbly.texture_coordinates()
    share = np.abs(np.linalg.det(pieces.barycentrics))
    covered = np.bincount(pieces.triangle, share, len(crumbly.mesh.F))
    np.testing.assert_allclose(covered, 1.0, atol=1e-6)


def test_a_push_on_a_part_that_lies_still_moves_nothing(crumbly: Atlas, tmp_path: Path) -> None:
    crumbly.save(tmp_path / "crumbs.npz")
    for atlas in (crumbly, load_atlas(tmp_path / "crumbs.npz")):
        waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
        crumb = atlas.mesh.V[-1]
        waves.add_impulse(crumb, 1e-3, 0.0)
        waves.step(0.1)
        assert not waves.height[atlas.texels.topology.still].any()
        assert np.abs(waves.height).max() == 0.0
        waves.add_impulse([0.0, 0.0, 1.0], 1e-3, 0.3)
        waves.step(0.1)
        assert np.abs(waves.height[~atlas.texels.topology.still]).max() > 0
        assert not waves.height[atlas.texels.topology.still].any()


def test_a_part_that_cannot_be_laid_out_lies_still_and_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(part: TriangleSurface, count: int, large: bool) -> Quads:
        raise AtlasError("4 triangles of the surface are too thin to be laid out flat")

    monkeypatch.setattr(layout, "quads_of", fail)
    mesh = joined(sphere(2), moved(torus(6), (3, 0, 0), 0.3))
    atlas = build_atlas(mesh, 24, cache=False)
    assert any("a part of" in note and "lies still: 4 triangles" in note for note in atlas.notes)
    n = atlas.resolution
    still = atlas.texels.topology.still[atlas.nearest_texel(mesh.V) // (n * n)]
    np.testing.assert_array_equal(still, np.abs(mesh.V[:, 0]) > 1.5)


def test_parts_of_one_shape_are_cut_into_charts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    cut = []

    def quads_of(part: TriangleSurface, count: int, large: bool) -> Quads:
        cut.append(part)
        return quads.quads_of(part, count, large)

    monkeypatch.setattr(layout, "quads_of", quads_of)
    small = torus(6)
    turn = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    turned = Mesh.from_arrays(small.V @ turn.T, small.F)
    mesh = joined(sphere(2), moved(small, (3, 0, 0), 0.3), moved(turned, (-3, 0, 0), 0.3))
    atlas = build_atlas(mesh, 24, cache=False)
    assert len({id(part) for part in cut if len(part.F) == len(small.F)}) == 1
    parts = mesh.components[atlas.triangles]
    assert (parts == 1).sum() == (parts == 2).sum()
    assert atlas.quality()["flipped"] == 0
    assert atlas.quality()["coverage"] == pytest.approx(1.0, abs=1e-3)


def test_a_failed_second_cut_of_a_part_keeps_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    cuts = []

    def cut_once(part: TriangleSurface, count: int, large: bool) -> Quads:
        # the second part first gets too few charts for its area, then none
        cuts.append(count)
        if len(cuts) > 1:
            raise AtlasError("4 triangles of the surface are too thin to be laid out flat")
        return quads.quads_of(part, 1, False)

    monkeypatch.setattr(layout, "quads_of", cut_once)
    mesh = joined(sphere(2), moved(torus(8), (3, 0, 0)))
    patches = patch_map(mesh.V, mesh.F, 48)
    assert len(cuts) > 1
    assert len(patches.seamless.glued) > 0


def test_texels_astride_of_a_knife_edge_are_put_in_order() -> None:
    mesh = blade()
    patches = patch_map(mesh.V, mesh.F, 24)
    atlas = atlas_from_patch_map(mesh, patches, 24)
    samples = centres(mesh, patches, atlas.texels.resolution)
    topology = glue(patches.seamless.glued, atlas.texels.resolution)
    centred = TexelMesh.of(topology, samples.positions, normals=samples.normals)
    assert folded_texels(centred) > 8
    assert atlas.quality()["folded"] == 0
    away = (centred.positions != atlas.positions).any(axis=-1)
    assert 0 < away.mean() < 0.3


MODES = 10


def on_sphere(points: np.ndarray) -> np.ndarray:
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def hemisphere() -> Mesh:
    flat = disk(12)
    x, y, _ = flat.V.T
    angle = np.pi / 2 * np.hypot(x, y)
    across = np.sin(angle) / np.maximum(np.hypot(x, y), 1e-12)
    return Mesh.from_arrays(np.stack([across * x, across * y, np.cos(angle)], axis=1), flat.F)


def degrees(multiplicity: Callable[[int], int]) -> np.ndarray:
    return np.concatenate([np.full(multiplicity(d), d * (d + 1.0)) for d in range(9)])


def texel_meshes(mesh: Mesh, project: Callable[[np.ndarray], np.ndarray]) -> list[TexelMesh]:
    """At two resolutions, with the texels on the true surface."""
    patches = patch_map(mesh.V, mesh.F, 24)
    meshes = []
    for n in (8, 16):
        texels = atlas_from_patch_map(
            mesh, patches, round(n * np.sqrt(len(patches.seamless.glued) / 6))
        ).texels
        beyond = None if texels.beyond is None else project(texels.beyond)
        meshes.append(
            TexelMesh.of(
                texels.topology, project(texels.positions), normals=texels.normals, beyond=beyond
            )
        )
    return meshes


@pytest.mark.parametrize(
    ("mesh", "project", "exact"),
    [
        (lambda: sphere(2), on_sphere, {"free": degrees(lambda d: 2 * d + 1)}),
        (hemisphere, on_sphere, {"free": degrees(lambda d: d + 1), "fixed": degrees(lambda d: d)}),
        (
            lambda: square(4),
            np.asarray,
            {rim: square_eigenvalues(rim) for rim in ("free", "fixed")},
        ),
    ],
    ids=["sphere", "hemisphere", "square"],
)
def test_eigenvalues_are_of_second_order(
    mesh: Callable, project: Callable, exact: dict[str, np.ndarray]
) -> None:
    meshes = texel_meshes(mesh(), project)
    for rim, values in exact.items():
        moving = values[:MODES] > 0
        errors = []
        for texels in meshes:
            found = eigenvalues(texels.with_fixed_rim() if rim == "fixed" else texels, MODES)
            errors.append(np.abs(found / np.where(moving, values[:MODES], 1) - 1)[moving])
        texel = np.sqrt([each.areas.mean() for each in meshes])
        order = np.log(errors[0].mean() / errors[1].mean()) / np.log(texel[0] / texel[1])
        assert order > 1.9, rim
        # the error of a mode of wave number k is that of the grid, (k texel)^2
        assert (errors[1] < 0.2 * values[:MODES][moving] * texel[1] ** 2).all(), rim
