"""The atlas locates points, also where charts meet; files round-trip, or name the damage."""

import copy
import itertools
import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh
from all_kinds import BALL
from hypothesis import given, settings, strategies as st

from ripple_sim.solver import Atlas, Mesh, sphere_atlas
from ripple_sim.solver.layouts import atlas_from_sphere_map
from ripple_sim.solver.layouts.cube import CHART_NORMALS, CHART_U, CHART_V
from ripple_sim.solver.texels import ChartPage, read_arrays, write_arrays

quick = settings(derandomize=True, max_examples=60, deadline=None, database=None)
DIAGONALS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def assert_touching(chart, row, column, n: int) -> None:
    """Places of the cube's corners, edges and faces, on the border of a chart that has them."""
    on = DIAGONALS[np.arange(26), chart // 2]
    np.testing.assert_array_equal(on, 1 - 2 * (chart % 2))
    offset = np.abs(np.stack([row, column]) - (n - 1) / 2)
    at_border = np.isclose(offset, n / 2, atol=1e-6)
    in_middle = np.isclose(offset, 0, atol=1e-6)
    np.testing.assert_array_equal(at_border.sum(axis=0), np.count_nonzero(DIAGONALS, axis=1) - 1)
    assert (at_border | in_middle).all()


def test_cube_edges_and_corners_are_located_on_the_sphere() -> None:
    atlas = sphere_atlas(2.0, 16)
    assert_touching(*atlas.locate(3 * DIAGONALS), 16)
    nearest = atlas.positions.reshape(-1, 3)[atlas.nearest_texel(DIAGONALS)]
    distance = np.linalg.norm(
        nearest - 2 * DIAGONALS / np.linalg.norm(DIAGONALS, axis=1, keepdims=True), axis=1
    )
    assert distance.max() < 2 * np.pi / 2 / 16  # a texel's width


def test_cube_edges_and_corners_are_located_on_a_mesh_with_vertices_there() -> None:
    box = trimesh.creation.box(extents=[2, 2, 2]).subdivide().subdivide()
    mesh = Mesh.from_arrays(box.vertices, box.faces)
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), 16)
    assert_touching(*atlas.locate(DIAGONALS), 16)


@quick
@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda d: np.linalg.norm(d) > 1e-3)
)
def test_located_points_lie_in_their_chart(direction) -> None:
    mesh = Mesh.from_arrays(BALL.vertices, BALL.faces)
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), 8)
    _, [onto] = atlas.project(direction)
    chart, row, column = (x[0] for x in atlas.locate(direction))
    a, b = np.tan(np.pi / 4 * ((2 * np.array([column, row]) + 1) / 8 - 1))
    back = CHART_NORMALS[chart] + a * CHART_U[chart] + b * CHART_V[chart]
    np.testing.assert_allclose(back / np.linalg.norm(back), onto, atol=1e-12)
    assert max(abs(a), abs(b)) <= 1 + 1e-12


def test_locate_returns_the_texel_that_a_point_was_taken_from(animal: Atlas) -> None:
    n = animal.resolution
    chart, row, column = (
        x.reshape(6, n, n) for x in animal.locate(animal.positions.reshape(-1, 3))
    )
    assert (chart == np.arange(6)[:, None, None]).all()
    np.testing.assert_allclose(row, np.broadcast_to(np.arange(n)[:, None], (6, n, n)), atol=1e-6)
    np.testing.assert_allclose(column, np.broadcast_to(np.arange(n), (6, n, n)), atol=1e-6)


def test_an_atlas_that_has_located_points_can_be_copied_and_pickled() -> None:
    mesh = Mesh.from_arrays(BALL.vertices, BALL.faces)
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), 8)
    expected = atlas.locate(DIAGONALS)
    for twin in (copy.copy(atlas), copy.deepcopy(atlas), pickle.loads(pickle.dumps(atlas))):
        np.testing.assert_array_equal(twin.locate(DIAGONALS), expected)
        assert type(twin) is Atlas
        np.testing.assert_array_equal(twin.positions, atlas.positions)


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {
        "positions": rng.standard_normal((2, 3, 4)),
        "triangles": rng.integers(0, 100, (5, 3)).astype(np.int32),
        "kind": np.array(["Atlas"]),
        "nothing": np.empty((0, 3)),
        "scalar": np.array(7),
        "transposed": rng.standard_normal((3, 2)).T,
    }


def written(path: Path, arrays: dict[str, np.ndarray]) -> bytes:
    with path.open("wb") as file:
        write_arrays(file, {name: np.ascontiguousarray(array) for name, array in arrays.items()})
    return path.read_bytes()


def same(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    return found.keys() == expected.keys() and all(
        found[name].dtype == expected[name].dtype and np.array_equal(found[name], expected[name])
        for name in expected
    )


def test_arrays_come_back_and_numpy_reads_them_too(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    written(tmp_path / "arrays.npz", arrays)
    expected = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    found = read_arrays(tmp_path / "arrays.npz")
    assert same(found, expected)
    assert all(array.flags.writeable for array in found.values())
    with np.load(tmp_path / "arrays.npz") as file:
        assert same({name: file[name] for name in file.files}, expected)


def test_no_flipped_bit_changes_an_array(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    path = tmp_path / "arrays.npz"
    whole = written(path, {name: arrays[name] for name in ("positions", "kind")})
    expected = read_arrays(path)
    bits = np.random.default_rng(1).integers(0, 8, len(whole))
    refused = 0
    for place, bit in list(enumerate(bits))[::3]:
        changed = bytearray(whole)
        changed[place] ^= 1 << bit
        path.write_bytes(changed)
        try:
            found = read_arrays(path)
        except ValueError:
            refused += 1
        else:  # a date or an unused flag of the archive, or a name: the content is sound
            assert all(
                any(np.array_equal(array, other) for other in expected.values())
                for array in found.values()
            )
    assert refused > 0.2 * len(whole)


def test_no_part_of_a_file_is_taken_for_the_whole(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    path = tmp_path / "arrays.npz"
    whole = written(path, arrays)
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"."):
            read_arrays(path)


def test_pickled_arrays_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "pickled.npz", a=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="Object arrays"):
        read_arrays(tmp_path / "pickled.npz")


PAGES = [ChartPage(1, 4), ChartPage(2, 4), ChartPage(5, 3), ChartPage(6, 8), ChartPage(17, 5)]


@pytest.mark.parametrize("page", PAGES)
def test_every_chart_has_a_block_of_its_own_on_the_page(page: ChartPage) -> None:
    width, height = page.size
    taken = np.zeros((height, width), int)
    for chart in range(page.charts):
        column, row = page.corner(chart)
        assert (
            taken[row : row + page.resolution + 2, column : column + page.resolution + 2].size
            == page.block**2
        )
        taken[row : row + page.block, column : column + page.block] += 1
    assert taken.max() == 1
    # no row of blocks stays empty
    assert taken[-1].any()


@pytest.mark.parametrize("page", PAGES)
def test_locating_a_place_gives_back_its_chart_row_and_column(page: ChartPage) -> None:
    rng = np.random.default_rng(0)
    chart = rng.integers(0, page.charts, 200)
    uv = rng.uniform(0, 1, (200, 2))
    uv[:4] = [[0, 0], [1, 0], [1, 1], [0, 1]]  # borders of a chart are still its own
    found, row, column = page.locate(page.places(chart, uv))
    np.testing.assert_array_equal(found, chart)
    np.testing.assert_allclose(
        np.stack([column, row], axis=1), page.resolution * uv - 0.5, atol=1e-9
    )


@pytest.mark.parametrize("page", PAGES)
def test_texel_centres_lie_in_the_middle_of_the_pages_texels(page: ChartPage) -> None:
    n = page.resolution
    for chart in range(page.charts):
        [[x, y]] = page.places(np.array([chart]), np.array([[0.5 / n, (n - 0.5) / n]]))
        column, row = page.corner(chart)
        # beyond the halo of one texel
        assert (x, y) == pytest.approx((column + 1.5, row + n + 0.5))
