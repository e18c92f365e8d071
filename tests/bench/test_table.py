"""The bodies of the paper's table 1."""

import pytest

from ripple_sim.bench.report import POLYGONS, knobbly_body


@pytest.mark.parametrize("count", POLYGONS)
def test_bodies_have_the_polygons_they_are_asked_for(count: int) -> None:
    assert len(knobbly_body(count).F) == count
