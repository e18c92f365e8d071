import numpy as np

from ripple_sim.render.surfaces.surface import ChartedMesh
from ripple_sim.render.surfaces.vertices import in_memory_order, morton_order


def test_points_of_one_octant_are_consecutive():
    points = np.random.default_rng(1).random((800, 3))
    points[0], points[1] = 0, 1
    octant = (points >= 512 / 1023)[morton_order(points)] @ [1, 2, 4]
    assert np.flatnonzero(np.diff(octant)).size == 7


def test_points_at_one_place_keep_their_order():
    assert (morton_order(np.ones((5, 3))) == np.arange(5)).all()


def test_a_mesh_keeps_its_triangles():
    rng = np.random.default_rng(2)
    position = rng.random((40, 3))
    F = rng.permuted(np.tile(np.arange(40), (90, 1)), axis=1)[:, :3]
    mesh = ChartedMesh(F, position, np.arange(40), np.arange(40) % 6)
    ordered = in_memory_order(mesh, slice(0, 3))

    def rows(mesh: ChartedMesh) -> list:
        per_corner = [mesh.attributes, mesh.same[:, None], mesh.chart[:, None]]
        return sorted(np.concatenate(per_corner, axis=1)[mesh.F].reshape(-1, 15).tolist())

    assert rows(ordered) == rows(mesh)
    _, first = np.unique(ordered.F, return_index=True)
    assert (np.diff(first) > 0).all()  # vertices stand in the order of their first use
