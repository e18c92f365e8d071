"""Distance along the surface."""

import trimesh

from ripple_sim.solver import Mesh, build_atlas
from ripple_sim.solver.waves.footprint import footprint


def test_distance_along_a_folded_surface_goes_round_the_edge() -> None:
    plate = trimesh.creation.box(extents=(1.0, 1.0, 0.02))
    V, F = trimesh.remesh.subdivide_to_size(plate.vertices, plate.faces, max_edge=0.06)
    atlas = build_atlas(Mesh.from_arrays(V, F), 64, cache=False)
    # 0.1 from the rim: the way to the same place below is 0.1 + 0.02 + 0.1
    where = footprint(atlas, [0.4, 0.0, 0.01], 0.2)
    hit = atlas.positions.reshape(-1, 3)[where.texels]
    below = hit[hit[:, 2] < -0.005]
    assert len(below) > 0
    assert below[:, 0].min() > 0.4 - 0.02
