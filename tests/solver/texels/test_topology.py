"""The connectivity of charts: what lies beyond each side, and the addresses that copy it."""

import numpy as np
import pytest
from hand_made import RIM, flat_torus, polygon, square

from ripple_sim.solver import TexelTopology, glue
from ripple_sim.solver.layouts.cube.convention import cube_topology

TOPOLOGIES = {
    "cube": lambda: cube_topology(4),
    "torus": lambda: flat_torus(4).topology,
    "square": lambda: square(4).topology,
    "pentagon": lambda: polygon(5, 4).topology,
    # front and back of a pillow: they share all four sides
    "pillow": lambda: glue(np.array([[(1, 0), (1, 3), (1, 2), (1, 1)], [(0, 0), (0, 3), (0, 2), (0, 1)]]), 4),
}


@pytest.fixture(params=TOPOLOGIES)
def topology(request: pytest.FixtureRequest) -> TexelTopology:
    return TOPOLOGIES[request.param]()


def test_glued_sides_run_against_each_other() -> None:
    halo = TOPOLOGIES["pillow"]().halo
    back = 16 + np.arange(16).reshape(4, 4)
    np.testing.assert_array_equal(halo[0, 0, 1:-1], back[0, ::-1])
    np.testing.assert_array_equal(halo[0, -1, 1:-1], back[-1, ::-1])
    np.testing.assert_array_equal(halo[0, 1:-1, -1], back[:, 0])
    np.testing.assert_array_equal(halo[0, 1:-1, 0], back[:, -1])


def test_a_side_may_be_glued_to_the_next_side_of_its_own_chart() -> None:
    # a cone: south on west, its tip in corner 0
    topology = glue(np.array([[(0, 3), RIM, RIM, (0, 0)]]), 3)
    np.testing.assert_array_equal(topology.halo[0, 0, 1:-1], [0, 3, 6])
    np.testing.assert_array_equal(topology.halo[0, 1:-1, 0], [0, 1, 2])
    assert topology.valence.tolist() == [[1, 0, 0, 0]]
    assert topology.corners[0, 1] == topology.corners[0, 3]


def test_every_step_over_a_border_leads_back(topology: TexelTopology) -> None:
    n = topology.shape[1]
    beside = {texel: set() for texel in range(topology.texel_count)}
    for chart, r, c in np.ndindex(*topology.shape):
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            if not topology.rim[chart, r + 1 + dr, c + 1 + dc]:
                beside[(chart * n + r) * n + c].add(int(topology.halo[chart, r + 1 + dr, c + 1 + dc]))
    assert all(texel in beside[other] for texel, others in beside.items() for other in others)


def test_halos_of_a_torus_and_of_a_square_are_those_of_wrapped_and_repeated_borders() -> None:
    field = np.random.default_rng(0).standard_normal((1, 4, 4))
    wrapped = TOPOLOGIES["torus"]().with_halo(field)[0]
    repeated = TOPOLOGIES["square"]().with_halo(field)[0]
    np.testing.assert_array_equal(wrapped, np.pad(field[0], 1, mode="wrap"))
    np.testing.assert_array_equal(repeated, np.pad(field[0], 1, mode="edge"))


def test_where_no_texel_lies_a_field_with_halo_is_0() -> None:
    around = TOPOLOGIES["cube"]().with_halo(np.ones((6, 4, 4, 2)))
    assert around.shape == (6, 6, 6, 2)
    empty = np.zeros((6, 6), bool)
    empty[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert ((around == 0).all(axis=(0, 3)) == empty).all()
    assert (around[:, ~empty] == 1).all()


def test_addresses_copy_the_same_halo_as_the_table(topology: TexelTopology) -> None:
    field = np.random.default_rng(1).standard_normal(topology.shape)
    flat = np.zeros(topology.halo.size)
    flat[topology.addresses.texels] = field.ravel()
    flat[topology.addresses.ghosts] = flat[topology.addresses.sources]
    np.testing.assert_array_equal(flat.reshape(topology.halo.shape), topology.with_halo(field))
    charts, n, _ = topology.shape
    assert len(topology.addresses.ghosts) == charts * (4 * n + 4) - (topology.halo < 0).sum()


def test_the_tables_cannot_be_changed(topology: TexelTopology) -> None:
    for table in (topology.halo, topology.rim, topology.valence, topology.corners):
        with pytest.raises(ValueError, match="read-only"):
            table.flat[0] = 0
