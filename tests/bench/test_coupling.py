"""What the coupling costs: measured on bodies that touch, and in parts that belong together."""

import pytest

from ripple_sim.bench.coupling import coupling_cost
from ripple_sim.scenes.shapes import ellipsoid, polygonise


def coarse_egg():
    return polygonise(ellipsoid((0.0, 0.0, 0.2), (0.4, 0.3, 0.2)), ((-0.5, -0.5, -0.1), (0.5, 0.5, 0.5)), 0.1)


def test_coupling_is_measured_on_bodies_that_touch() -> None:
    cost = coupling_cost({"egg": coarse_egg}, seconds=0.5, bodies=2, resolution=8, rounds=1)["egg"]
    assert cost["touching"] > 0
    assert min(cost["mj_step [s]"], cost["coupling [s]"], cost["waves [s]"]) > 0
    assert cost["of mj_step"] == pytest.approx(cost["coupling [s]"] / cost["mj_step [s]"])
