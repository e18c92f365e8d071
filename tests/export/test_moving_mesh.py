"""Points, normals and velocities of moving meshes."""

import numpy as np
import pytest
from surfaces import grid

from ripple_sim import Material
from ripple_sim.export import MovingMesh
from ripple_sim.render.visuals import smooth_normals
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.texels import with_filled_halo


@pytest.fixture(scope="module", params=["cube", "patches"])
def atlas(request: pytest.FixtureRequest) -> Atlas:
    if request.param == "cube":
        V, F = limbed()
    else:  # an open square sheet
        V, F = grid(8, lambda x, y: (2 * x - 1, 2 * y - 1, 0.1 * (2 * x - 1) * (2 * y - 1)))
    return build_atlas(Mesh.from_arrays(V, F), 16, layout=request.param, cache=False)


def smooth_field(atlas: Atlas, amplitude: float) -> np.ndarray:
    x, y, z = np.moveaxis(atlas.positions, -1, 0)
    return (amplitude * np.sin(3 * x + 1) * np.cos(2 * y) * np.cos(z)).astype(np.float32)


def height_at(atlas: Atlas, field: np.ndarray, point: np.ndarray) -> float:
    """The quadratic B-spline over a field, by its definition, in float64."""
    around = with_filled_halo(atlas.texels.topology, field).astype(np.float64)
    [chart], [row], [column] = atlas.locate(point[None])

    def weight(distance: float) -> float:
        d = abs(distance)
        return 0.75 - d**2 if d <= 0.5 else 0.5 * (1.5 - d) ** 2 if d <= 1.5 else 0.0

    centres = np.arange(around.shape[1]) - 1  # of texels, with the halo
    in_rows, in_columns = ([weight(centre - at) for centre in centres] for at in (row, column))
    return float(in_rows @ around[chart] @ in_columns)


def test_own_vertices_are_raised_by_the_spline_along_the_smooth_normals(atlas: Atlas) -> None:
    mesh = MovingMesh(atlas, "own", limit=False)
    field = smooth_field(atlas, 0.05)
    shape = mesh.shape(field, 2 * field)
    V = atlas.mesh.V
    F = atlas.mesh.F
    normals = smooth_normals(V, F)
    size = np.ptp(V, axis=0).max()
    for face in range(0, len(F), max(len(F) // 20, 1)):
        vertex = F[face, 0]
        point = mesh.F[face, 0]
        height = height_at(atlas, field, V[vertex])
        assert (
            np.abs(shape.points[point] - (V[vertex] + height * normals[vertex])).max() < 1e-6 * size
        )
        assert np.abs(shape.velocities[point] - 2 * height * normals[vertex]).max() < 1e-6 * size
        assert shape.height[point] == pytest.approx(height, abs=1e-6)


def test_refined_meshes_stay_closed_and_no_edge_is_longer_than_about_a_texel(atlas: Atlas) -> None:
    mesh = MovingMesh(atlas, "refined")
    points = mesh.shape(smooth_field(atlas, 0.05), smooth_field(atlas, 0.0)).points
    edges = np.sort(mesh.F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    length = np.linalg.norm(mesh.rest[edges[:, 0]] - mesh.rest[edges[:, 1]], axis=1)
    assert length.max() <= 1.001 * np.sqrt(atlas.areas.mean())
    places = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    sides = np.unique(np.sort(places[edges], axis=1), axis=0, return_counts=True)[1]
    assert (sides == 1).any() == (not atlas.mesh.closed)
    assert sides.max() == 2


def test_normals_tip_against_the_gradient_of_the_height() -> None:
    atlas = sphere_atlas(1.0, 48)
    amplitude = 0.02
    mesh = MovingMesh(atlas, triangles=24_000)
    x, _, z = np.moveaxis(atlas.positions, -1, 0)
    field = (amplitude * x * z).astype(np.float32)
    shape = mesh.shape(field, field)
    still = mesh.shape(0 * field, field).normals
    out = mesh.rest / np.linalg.norm(mesh.rest, axis=1, keepdims=True)
    wave = amplitude * out[:, 0] * out[:, 2]
    np.testing.assert_allclose(shape.height, wave, atol=2e-3 * amplitude)
    np.testing.assert_allclose(
        np.linalg.norm(shape.points - mesh.rest, axis=1), np.abs(wave), atol=3e-3 * amplitude
    )
    # gradient on the unit sphere of a x z: the plane gradient (z, 0, x) a without its radial part
    gradient = amplitude * np.stack([out[:, 2], np.zeros(len(out)), out[:, 0]], axis=1)
    tipped = still - gradient + np.einsum("ij,ij->i", gradient, out)[:, None] * out
    tipped /= np.linalg.norm(tipped, axis=1, keepdims=True)
    assert (
        np.linalg.norm(shape.normals - tipped, axis=1).max()
        < 0.02 * np.linalg.norm(tipped - still, axis=1).max()
    )
    corners = mesh.rest[mesh.F]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", facing, corners.mean(axis=1)) > 0).all()


@pytest.mark.parametrize("limit", [False, True])
def test_velocities_are_the_rates_of_the_points_also_where_heights_are_bent(limit: bool) -> None:
    atlas = sphere_atlas(1.0, 16)
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.height = smooth_field(atlas, 0.5)
    waves.velocity = smooth_field(atlas, 0.3)
    mesh = MovingMesh(atlas, "refined", limit=limit)
    step = 1e-3
    shapes = []
    for _ in range(3):
        waves.step(step)
        shapes.append(mesh.shape(waves.height, waves.velocity))
    differences = (shapes[2].points.astype(float) - shapes[0].points) / (2 * step)
    peak = np.linalg.norm(differences, axis=1).max()
    assert peak > 0.01
    assert np.linalg.norm(shapes[1].velocities - differences, axis=1).max() < 0.01 * peak
